"""The plan of an AS-i installation: what it is made of, what it does to signals, its rules."""

from shipnet.asi.network.elements import CableRun, Master, Repeater, Slave, Supply, Terminator
from shipnet.asi.network.file import load_plan, save_plan
from shipnet.asi.network.plan import Plan
from shipnet.asi.network.rules import check, rule_limits, worst

__all__ = ["CableRun", "Master", "Plan", "Repeater", "Slave", "Supply", "Terminator"]
__all__ += ["check", "load_plan", "rule_limits", "save_plan", "worst"]
