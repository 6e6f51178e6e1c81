"""Rules for a planned network, and every single failure of it."""

from shipnet.design.rules.check import HOST_TIME, RuleSet, check, rules_of
from shipnet.design.rules.cuts import lost, single_cuts, worst
from shipnet.design.rules.rule_set import RULE_SETS, Rule, load_rules, published_rules

__all__ = ["HOST_TIME", "RULE_SETS", "Rule", "RuleSet", "check", "load_rules", "lost"]
__all__ += ["published_rules", "rules_of", "single_cuts", "worst"]
