"""The test inputs of the second Table 1, each diagnosed by the rules as printed."""

from __future__ import annotations

from itertools import product

import pandas as pd

from shipnet.ballast.registers import RegisterMap
from shipnet.ballast.rule_table import FILLS, rule_vectors
from shipnet.ballast.sensors import CHANNELS
from shipnet.papers.kim2014.rules import BASE
from shipnet.papers.registry import check, numeric

__all__ = ["diagnosed", "score_table", "through_registers"]

#: Ends of the position [%]: CLOSE and OPEN of the rule table, as section 3.2 scales it.
_CLOSE, _OPEN = 0.0, 100.0

#: Position that row 12 prints below the closed end [%].
_ROW_12 = float(rule_vectors("printed")["VPos"]["Pos4"])


def diagnosed(code: str, *, version: str = "printed", **inputs: float) -> str:
    """Return what the rules as printed make of a row's inputs.

    Parameters
    ----------
    code : str
        Code of the row.
    version : {"printed", "corrected"}, default "printed"
        Inputs as printed, or corrected.
    **inputs : float
        Other values for some of them.

    Returns
    -------
    str
        Headline: the code of the highest priority that fires, or ``normal``.

    Examples
    --------
    >>> diagnosed("S2"), diagnosed("S2", VPos=-5.0)
    ('S1', 'S2')
    """
    tests = rule_vectors(version).loc[[code]].assign(**inputs)
    return str(BASE.check(tests, "crisp")["top"].iloc[0])


def score_table() -> pd.DataFrame:
    """Return how many of the 13 rows are found, as printed and corrected, with every fill.

    Returns
    -------
    pandas.DataFrame
        Indexed by version of the ``inputs`` and ``fill`` of what they leave out: rows found by
        ``crisp`` comparisons and by ``fuzzy`` strengths, and what the comparisons make of the
        others, ``not found``.

    Examples
    --------
    >>> score_table().loc[("printed", "absent")].tolist()
    [10, 10, 'V2 as normal, S2 as S1, Pos2 as normal']
    """
    rows = {}
    for version, fill in product(("printed", "corrected"), FILLS):
        tests = rule_vectors(version, fill=fill)
        crisp, fuzzy = BASE.check(tests, "crisp"), BASE.check(tests)
        missed = crisp[~crisp["right"]]
        said = missed["expected"] + " as " + missed["top"]
        found = [int(one["right"].sum()) for one in (crisp, fuzzy)]
        rows[version, fill] = (*found, ", ".join(said))
    table = pd.DataFrame(rows, index=["crisp", "fuzzy", "not found"]).T
    return table.rename_axis(["inputs", "fill"])


def through_registers(code: str) -> str:
    """Return what the rules make of a corrected row, once its readings came through registers.

    What the row does not print is as the plant would have it; the speed is not sent, so it is
    taken from the row.

    Parameters
    ----------
    code : str
        Code of the row.

    Returns
    -------
    str
        Headline.

    Examples
    --------
    A position of -5 arrives as 0:

    >>> through_registers("S1"), through_registers("S2")
    ('S1', 'normal')
    """
    tests = rule_vectors(fill="physical").loc[[code]]
    names = [channel.name for channel in CHANNELS]
    registers = RegisterMap().pack(tests[names].to_numpy().T, close=False, open=True).registers
    received = pd.DataFrame(RegisterMap().unpack(registers).readings.T, tests.index, names)
    tests = received.assign(DVPos=tests["DVPos"])
    return str(BASE.check(tests, "crisp")["top"].iloc[0])


@check("kim2014-026", counter={"speed": 11.0})
def normal_stays_normal(*, speed: float = 0.0) -> bool:
    """Whether the normal values raise no fault at this speed of the valve [%/s]."""
    return diagnosed("normal", DVPos=speed) == "normal"


@check("kim2014-027", counter={"current": 0.0})
def pump_overload(*, current: float = 4.0) -> bool:
    """Whether FP 125 with this current [A] is P1."""
    return diagnosed("P1", MC=current) == "P1"


@check("kim2014-028", counter={"pressure": 90.0})
def pump_leakage(*, pressure: float = 2.0) -> bool:
    """Whether MC 2 with this pump pressure [bar] is P2."""
    return diagnosed("P2", FP=pressure) == "P2"


@check("kim2014-029", counter={"pressure": 2.0})
def valve_stuck(*, pressure: float = 4.0) -> bool:
    """Whether FP 125 with this operating pressure [bar] is V1, at both ends."""
    return all(diagnosed("V1", OP=pressure, VPos=end) == "V1" for end in (_CLOSE, _OPEN))


@check("kim2014-030", counter={"current": 1.2})
def gauge_fault(*, current: float = 0.0) -> bool:
    """Whether FP 125 with this current [A] is G1."""
    return diagnosed("G1", MC=current) == "G1"


@check("kim2014-031", counter={"speed": 0.0})
def piston_leakage(*, speed: float = float("nan")) -> bool:
    """Whether OP 2 with this speed [%/s], which the row does not print, is V2."""
    return all(diagnosed("V2", DVPos=speed, VPos=end) == "V2" for end in (_CLOSE, _OPEN))


@check("kim2014-064", counter={"position": 100.0})
def switch_error(*, position: float = 305.0) -> bool:
    """Whether MC 0 with this position [%] is S1."""
    return diagnosed("S1", VPos=position) == "S1"


@check("kim2014-035", counter={"temperature": 89.0})
def motor_too_hot(*, temperature: float = 90.0) -> bool:
    """Whether this motor temperature [degC] is O1."""
    return diagnosed("O1", OT=temperature) == "O1"


@check("kim2014-065", counter={"current": 1.2})
def position_error_1(*, current: float = 0.0) -> bool:
    """Whether OP 2, VPos 305 with this current [A] is Pos1."""
    return diagnosed("Pos1", MC=current) == "Pos1"


@check("kim2014-066", counter={"position": 100.0})
def position_error_3(*, position: float = 305.0) -> bool:
    """Whether this position [%] alone is Pos3."""
    return diagnosed("Pos3", VPos=position) == "Pos3"


@check("kim2014-067", counter={"position": 5.0})
def position_error_4(*, position: float = -5.0) -> bool:
    """Whether this position [%] alone is Pos4."""
    return diagnosed("Pos4", VPos=position) == "Pos4"


@numeric("kim2014-032")
def above_open(*, below: float = _ROW_12) -> float:
    """Position as far above the open end as the input of row 12 is below the closed one [%]."""
    return _OPEN + (_CLOSE - below)


@numeric("kim2014-033", "kim2014-034")
def below_closed(*, margin: float = 5.0) -> float:
    """Position below the closed end, for which S2 and Pos2 fire [%]."""
    position = _CLOSE - margin
    fired = [diagnosed(code, VPos=position) for code in ("S2", "Pos2")]
    if fired != ["S2", "Pos2"]:
        raise ValueError(f"margin is {margin:g}; it must be above 0")
    return position


@check("kim2014-068", counter={"version": "corrected"})
def all_tests_pass(*, version: str = "printed") -> bool:
    """Whether each of the 12 inputs is diagnosed as its row says, as printed or corrected."""
    return all(diagnosed(code, version=version) == code for code in BASE.codes)


@check("kim2014-069", counter={"codes": ("G1", "P1", "P2", "V1", "V2", "O1")})
def master_finds(*, codes: tuple[str, ...] = BASE.codes) -> bool:
    """Whether a master finds these faults from the readings that the registers bring it."""
    return all(through_registers(code) == code for code in codes)
