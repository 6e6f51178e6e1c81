"""What stands in the outlines of kim2014: blocks, their places, and what leads where.

Words are from sections 1, 2.1, 2.3, 3.1, 3.2 and 4, and from the rule table; places are ours.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TypeAlias

__all__ = ["ACTUATOR", "ACTUATOR_WAYS", "ALGORITHM", "ALGORITHM_WAYS", "CENTRAL", "COMMAND"]
__all__ += ["COMMAND_WAYS", "MASTER", "MODES", "MODES_WAYS", "TESTBED", "TESTBED_WAYS", "Blocks"]
__all__ += ["Ways"]

#: Text, kind, and place of a block; pairs that are joined, and the word on the way.
Blocks: TypeAlias = Mapping[str, tuple[str, str, float, float]]
Ways: TypeAlias = Sequence[tuple[str, str, str]]

CENTRAL: Blocks = {
    "console": ("console", "control", 1, 3),
    "station": ("pump, tank and\nsolenoid valves", "oil", 1, 2),
}
MASTER: Blocks = {
    "master": ("master with\ntouch screen", "control", 1, 3),
    "power": ("power", "", 1, 2.15),
}

ACTUATOR: Blocks = {
    "relay": ("control module\nrelay outputs", "control", 0, 2),
    "motor": ("reversible motor", "", 1, 2),
    "pump": ("pump\nturns both ways", "oil", 2, 2),
    "rack": ("cylinder\nwith rack", "oil", 3, 2),
    "pinion": ("pinion", "valve", 4, 2),
    "valve": ("valve", "valve", 4, 3),
    "bus": ("communication\nmodule, Modbus", "control", 0, 3),
    "MC": ("current MC", "ask", 1, 1),
    "OT": ("temperature OT", "ask", 2, 1),
    "OP": ("pressures FP, OP", "ask", 3, 1),
    "VPos": ("potentiometer\nVPos", "ask", 4, 1),
    "ADC": ("A/D converter\n5 channels, 12 bit", "control", 0, 1),
}
ACTUATOR_WAYS: Ways = [
    ("bus", "relay", ""), ("relay", "motor", ""), ("motor", "pump", ""), ("pump", "rack", "oil"),
    ("rack", "pinion", ""), ("pinion", "valve", ""), ("pinion", "VPos", ""), ("motor", "MC", ""),
    ("motor", "OT", ""), ("pump", "OP", ""), ("rack", "OP", ""),
]  # fmt: skip

MODES: Blocks = {
    "start": ("auto/manual switch", "ask", 0, 2),
    "auto": ("command of the\nmaster by Modbus", "control", 1.3, 3),
    "position": ("position asked for,\nor an end", "control", 2.6, 3),
    "time": ("motor time\nis set", "", 1.3, 1),
    "switch": ("on-off-on switch:\nopen, stop, close", "", 2.6, 1),
    "motor": ("motor forward,\nstop, backward", "oil", 3.9, 2),
    "valve": ("valve, position\nby potentiometer", "valve", 5.2, 2),
}
MODES_WAYS: Ways = [
    ("start", "auto", "auto"), ("auto", "position", ""), ("position", "motor", ""),
    ("start", "time", "manual"), ("time", "switch", ""), ("switch", "motor", ""),
    ("motor", "valve", ""),
]  # fmt: skip

COMMAND: Blocks = {
    "receive": ("write register\nreceived", "control", 0, 3),
    "id": ("own id?", "ask", 1.3, 3),
    "ignore": ("keep silent", "", 1.3, 1.7),
    "way": ("which way?", "ask", 2.6, 3),
    "run": ("motor runs", "oil", 3.9, 3),
    "there": ("position\nreached?", "ask", 3.9, 1.7),
    "reply": ("reply: result\nand diagnosis", "control", 5.2, 1.7),
    "echo": ("reply at once:\nwhat we propose", "valve", 5.2, 3),
}
COMMAND_WAYS: Ways = [
    ("receive", "id", ""), ("id", "ignore", "no"), ("id", "way", "yes"), ("way", "run", ""),
    ("run", "there", ""), ("there", "reply", "yes"), ("run", "echo", ""),
]  # fmt: skip

ALGORITHM: Blocks = {
    "sensors": ("five sensors\nof a valve", "", 0, 2),
    "poll": ("master reads\nby Modbus RTU", "control", 1.3, 2),
    "limits": ("upper and lower\nlimit of a sensor", "control", 2.6, 3),
    "compare": ("above or below\na limit?", "ask", 2.6, 2),
    "rules": ("rule table:\nif ... then flag", "oil", 3.9, 2),
    "ramps": ("ramps, minimum,\ncut: our assumption", "valve", 3.9, 3),
    "cause": ("fault\nand its cause", "oil", 5.2, 2),
    "slave": ("slave finds\nPos1 to Pos4", "control", 0, 1),
    "display": ("display\nof the master", "control", 5.2, 1),
}
ALGORITHM_WAYS: Ways = [
    ("sensors", "poll", ""), ("poll", "compare", ""), ("limits", "compare", ""),
    ("compare", "rules", ""), ("ramps", "rules", ""), ("rules", "cause", ""),
    ("cause", "display", ""), ("sensors", "slave", ""),
    ("slave", "display", "row 9 of the table"),
]  # fmt: skip

TESTBED: Blocks = {
    "PC": ("PC\nsimulator of the\nship's system", "", 0.1, 3.2),
    "master": ("master", "control", 2, 3.2),
    "S1": ("S1", "control", 0.1, 2), "S2": ("S2", "control", 1.05, 2),
    "S3": ("S3", "control", 2, 2), "S4": ("S4", "control", 2.95, 2),
    "S5": ("S5", "control", 3.9, 2),
    "V2": ("butterfly valve", "valve", 1.05, 1),
    "V3": ("pump, valve,\nsmall tank", "valve", 2, 1),
    "V5": ("fault simulator", "ask", 3.9, 1),
}  # fmt: skip
TESTBED_WAYS: Ways = [("S2", "V2", ""), ("S3", "V3", ""), ("S5", "V5", "")]
