"""Rule tables: what fires, what is decided, and what a table leaves open."""

from shipnet.fuzzy.audit import corners, diagnose, overlap_matrix, overlaps, regions
from shipnet.fuzzy.centroid import centroid_codes
from shipnet.fuzzy.decide import Decision, decide
from shipnet.fuzzy.file import load_rules, save_rules
from shipnet.fuzzy.rules import NORMAL, UNKNOWN, Rule, RuleBase
from shipnet.fuzzy.scikit_fuzzy import control_strengths, to_skfuzzy
from shipnet.fuzzy.strengths import Firing, crisp_strengths, strengths
from shipnet.fuzzy.terms import Interval, Term, Variable

__all__ = ["NORMAL", "UNKNOWN", "Decision", "Firing", "Interval", "Rule", "RuleBase", "Term"]
__all__ += ["Variable", "centroid_codes", "control_strengths", "corners", "crisp_strengths"]
__all__ += ["decide", "diagnose", "load_rules", "overlap_matrix", "overlaps", "regions"]
__all__ += ["save_rules", "strengths", "to_skfuzzy"]
