"""The second Table 1 and section 3.4: rules, diagnosis, and the master's view of the valves."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import product
from typing import NamedTuple

import numpy as np
import pandas as pd

from shipnet import datasets
from shipnet.ballast.diagnosis import Run
from shipnet.ballast.master import MasterRun, operate
from shipnet.ballast.plant import FAULTS, Command, Fault, Plant
from shipnet.ballast.registers import RegisterMap
from shipnet.ballast.rule_table import FILLS, rule_base, rule_vectors
from shipnet.ballast.scan import System, status_poll
from shipnet.ballast.sensors import CHANNELS
from shipnet.ballast.slave import Monitor
from shipnet.ballast.trials import fault_trials
from shipnet.fuzzy.terms import NORMAL
from shipnet.modbus.faults import Break
from shipnet.modbus.frame import MAX_UNIT
from shipnet.papers.kim2014.line import MOVES
from shipnet.papers.registry import check, numeric

# The second Table 1 as a rule base: its faults, overlaps and gaps.

BASE = rule_base()

_TABLE = datasets.read("kim2014_rule_table.csv")
_POSITION_FLAG = "PosFault"


@numeric("kim2014-024")
def number_of_faults() -> int:
    """Number of faults that the rules diagnose."""
    return len(rule_base().codes)


@numeric("kim2014-025")
def flags(*, with_position: bool = True) -> int:
    """Number of flags that the rules set, with or without the flag for the position."""
    return len({rule.flag for rule in BASE.rules if with_position or rule.flag != _POSITION_FLAG})


@numeric("kim2014-036")
def nested_pairs(*, codes: tuple[str, ...] = BASE.codes) -> int:
    """Number of pairs of these rules in which one rule fires whenever the other does."""
    pairs = BASE.overlaps()
    nested = pairs[pairs["relation"] != "overlap"]
    return int((nested["a"].isin(codes) & nested["b"].isin(codes)).sum())


@numeric("kim2014-073")
def distinct_faults(*, equalities: bool = True) -> int:
    """Number of faults in the table; if `equalities`, without those printed as equal to another."""
    rows = _TABLE[_TABLE["code"] != "normal"]
    same = rows["diagnosis_printed"].str.contains(r"= Pos\d", regex=True)
    return int((~same).sum()) if equalities else len(rows)


@numeric("kim2014-074")
def overlaps(*, as_printed: bool = True) -> int:
    """Number of pairs of rules that can fire together, as printed or with limits moved."""
    return len(BASE.overlaps("crisp" if as_printed else "midpoint"))


@numeric("kim2014-082")
def silent_pressures(
    *, high: float = BASE["FP"]["high"].crisp.low, low: float = BASE["FP"]["none"].crisp.high
) -> float:
    """Width of the range of FP that no rule uses [bar]."""
    return high - low


@numeric("kim2014-100")
def sensors_with_limit(*, limit: float = 2.5) -> int:
    """Number of sensors that the rules compare with this limit."""
    limits = [[term.crisp for term in variable.terms] for variable in rule_base().variables]
    return sum(any(limit in (one.low, one.high) for one in terms) for terms in limits)


@numeric("kim2014-109")
def rules_at_rest() -> int:
    """Number of rules that need a current of 0, and so cannot fire while the motor runs."""
    terms = {term.name: term.crisp for term in BASE["MC"].terms}
    needed = [dict(rule.antecedent).get("MC") for rule in BASE.rules]
    return sum(name is not None and terms[name].high <= 0 for name in needed)


@check("kim2014-108", counter={"code": "S1"})
def is_diagnosed_while_moving(*, code: str = "V2") -> float:
    """Margin by which a slave finds this fault within a stroke of 10 s, its motor still running."""
    plant = Plant(1, [Fault(code)])
    monitor = Monitor(plant)
    plant.order(Command("open"))
    for tenths in range(100):
        plant.run_until(tenths / 10)
        if plant.running[0] and monitor.row(0) == BASE.codes.index(code) + 1:
            return 1 - plant.time / 10.0
    return -1.0


@check("kim2014-112", counter={"limit": 2.6})
def neither_fires_at(*, limit: float = 2.5) -> bool:
    """Whether P1 and P2 leave out this current [A], and no current 0.01 A above or below it."""

    def fires(current: float) -> bool:
        pressures = np.array([125.0, 2.0])  # P1 needs a high pressure, P2 almost none
        firing = BASE.fire({"FP": pressures, "MC": np.full(2, current)}, "crisp")
        return bool(firing["P1"][0] or firing["P2"][1])

    return not fires(limit) and fires(limit - 0.01) and fires(limit + 0.01)


# The test inputs of the second Table 1, each diagnosed by the rules as printed.

#: Positions CLOSE and OPEN of the rule table, on the scale of section 3.2 [%].
_CLOSE, _OPEN = 0.0, 100.0

#: Position printed in row 12 [%]; it lies below the closed end.
_ROW_12 = float(rule_vectors("printed")["VPos"]["Pos4"])

#: Ways to fill in the values that a row does not print: those of `rule_vectors`, and "held", in
#: which they are absent, except that DVPos is 0 if the row prints a position, as if the valve were
#: at rest. This does not apply to row 0, which also prints the time of a movement.
READINGS = ("held", *FILLS)


def row_inputs(version: str = "printed", reading: str = "held") -> pd.DataFrame:
    """Return the inputs of the 13 rows in one of the `READINGS`."""
    tests = rule_vectors(version, fill="absent" if reading == "held" else reading)
    if reading == "held":
        tests.loc[tests["VPos"].notna() & (tests.index != NORMAL), "DVPos"] = 0.0
    return tests


def fired(tests: pd.DataFrame, method: str = "crisp") -> pd.Series:
    """Return, for each row, the codes of the rules that fire when applied as printed."""
    return BASE.check(tests, method)["fired"].set_axis(tests.index)


def is_right(code: str, codes: str) -> bool:
    """Return whether the row's own rule fired; on the normal row no rule may fire."""
    return not codes if code == NORMAL else code in codes.split()


def reading_table() -> pd.DataFrame:
    """Return how many of the 13 rows, as printed and as corrected, are right in each reading.

    The columns count rows whose own rule ``fires``, fires with ``fuzzy`` ramps, or is the first to
    fire in ``our ranking`` or in ``table order``; ``not`` lists the rows missing from ``fires``. As
    in the paper, a row on which no rule fires is normal, even if it does not print all values.
    """
    rows = {}
    for version, reading in product(("printed", "corrected"), READINGS):
        tests = row_inputs(version, reading)
        crisp, fuzzy = fired(tests), fired(tests, "fuzzy")
        missed = [str(code) for code, codes in crisp.items() if not is_right(str(code), codes)]
        rows[version, reading] = {
            "fires": len(crisp) - len(missed),
            "fuzzy": sum(is_right(str(code), codes) for code, codes in fuzzy.items()),
            "our ranking": sum(first(codes, BASE.ranking) == code for code, codes in crisp.items()),
            "table order": sum(first(codes, BASE.codes) == code for code, codes in crisp.items()),
            "not": ", ".join(missed),
        }
    return pd.DataFrame(rows).T.rename_axis(["inputs", "reading"])


def first(codes: str, ranking: Sequence[str]) -> str:
    """Return the first of the codes that fired, in a ranking; the normal state if none did."""
    return min(codes.split() or [NORMAL], key=[NORMAL, *ranking].index)


def fired_table(version: str = "printed") -> pd.DataFrame:
    """Return the rules that fire on each row in each reading; ``-`` if none fires."""
    codes = {reading: fired(row_inputs(version, reading)) for reading in READINGS}
    return pd.DataFrame(codes).replace("", "-").rename_axis("row")


def through_registers(code: str) -> str:
    """Return the top-ranked fault for a corrected row after its readings are sent in registers.

    Missing values follow from the state that the row describes. DVPos is used without being sent;
    it does not apply while the motor is off.
    """
    tests = rule_vectors(fill="physical").loc[[code]]
    names = [channel.name for channel in CHANNELS]
    registers = RegisterMap().encode(tests[names].to_numpy().T, close=False, open=True).registers
    received = pd.DataFrame(RegisterMap().decode(registers).readings.T, tests.index, names)
    tests = received.assign(DVPos=tests["DVPos"])
    return str(BASE.decide(tests, "crisp", applies={"DVPos": tests["DVPos"].notna()}).top[0])


@check("kim2014-026", code="normal", channel="DVPos", value=0.0, counter={"value": 11.0})
@check("kim2014-027", code="P1", channel="MC", value=4.0, counter={"value": 0.0})
@check("kim2014-028", code="P2", channel="FP", value=2.0, counter={"value": 90.0})
@check("kim2014-030", code="G1", channel="MC", value=0.0, counter={"value": 1.2})
@check("kim2014-064", code="S1", channel="VPos", value=305.0, counter={"value": 100.0})
@check("kim2014-035", code="O1", channel="OT", value=90.0, counter={"value": 89.0})
@check("kim2014-065", code="Pos1", channel="MC", value=0.0, counter={"value": 1.2})
@check("kim2014-066", code="Pos3", channel="VPos", value=305.0, counter={"value": 100.0})
@check("kim2014-067", code="Pos4", channel="VPos", value=-5.0, counter={"value": 5.0})
def row_is_found(*, code: str, channel: str, value: float, version: str = "printed") -> bool:
    """Whether a row's own rule fires on its inputs if one channel has this value."""
    (codes,) = fired(row_inputs(version).loc[[code]].assign(**{channel: value}))
    return is_right(code, codes)


# V1 and V2 must be diagnosed with the valve closed and with it open.
@check("kim2014-029", code="V1", channel="OP", value=4.0, counter={"value": 2.0})
@check("kim2014-031", code="V2", channel="DVPos", value=0.0, counter={"value": 11.0})
def row_is_found_at_both_ends(*, code: str, channel: str, value: float) -> bool:
    """Whether a row's own rule fires with the valve closed and with it open."""
    ends = row_inputs().loc[[code, code]].assign(VPos=[_CLOSE, _OPEN]).assign(**{channel: value})
    return all(is_right(code, codes) for codes in fired(ends))


@numeric("kim2014-032")
def position_above_the_end(*, end: float = _OPEN, below: float = _ROW_12) -> float:
    """Position as far above `end` as row 12 is below the closed end [%]."""
    return end + (_CLOSE - below)


@check("kim2014-068", counter={"version": "printed"})
def all_tests_pass(*, version: str = "corrected") -> bool:
    """Whether each of the 12 rules fires on its own row's inputs, as printed or corrected."""
    fired_codes = fired(row_inputs(version)).drop(NORMAL)
    return all(is_right(str(code), codes) for code, codes in fired_codes.items())


@check("kim2014-069", counter={"codes": ("G1", "P1", "P2", "V1", "V2", "O1")})
def faults_survive_registers(*, codes: tuple[str, ...] = BASE.codes) -> bool:
    """Whether each of these faults is diagnosed from readings sent in registers."""
    return all(through_registers(code) == code for code in codes)


# Faults of different severity.


def graded_trials(*, rng: np.random.Generator) -> pd.DataFrame:
    """Open and close 101 valves once with each fault, at severities from 0 to 1.

    The table is that of `fault_trials`, with a column ``said`` for the diagnosis.
    """
    trials = fault_trials(
        FAULTS, n_valves=101, severity=np.linspace(0, 1, 101), methods=["fuzzy"], rng=rng
    ).table()
    top = trials["top_fault"]
    named = np.where(top == trials["fault"], "its own name", "another fault's name")
    return trials.assign(said=np.where(top == NORMAL, "nothing", named))


# Sections 2.1, 3.3 and 3.4: how late and how wrong a master's data can be.

#: Largest error of a position that counts as correct [%]: a register's step plus noise.
NEAR = 2.0


class Picture(NamedTuple):
    """A fleet as its master shows it, and the fleet itself."""

    seen: MasterRun
    plant: Plant


def seen_strokes(numbers: Iterable[int] = (5, 64, 247)) -> dict[int, Run]:
    """Return the readings that masters of these numbers of valves receive from their last valve.

    The bit rate is 9600 bit/s. The command to open, due after 3 s, follows the current poll.
    """
    runs = {}
    for number in numbers:
        order = Command("open", 3.0, valves=number)
        seen = operate(Plant(System(number, status_poll(9600))), [order], until=15.0)
        runs[number] = seen.received(number)
    return runs


def age_table() -> pd.DataFrame:
    """Return the greatest age of the data by the number of commands sent between the polls.

    ``formula_s`` is from `System.worst_age`, ``simulated_s`` from a run, both at 9600 bit/s.
    """
    system = System(MAX_UNIT, status_poll(9600))
    rows = {}
    for count in (0, 10, 100):
        orders = [Command("open", 25.0, valves=range(1, count + 1))] if count else []
        seen = operate(Plant(system), orders, until=50.0)
        rows[count] = (system.worst_age(commands=count), seen.oldest)
    table = pd.DataFrame.from_dict(rows, orient="index", columns=["formula_s", "simulated_s"])
    return table.rename_axis("commands")


def broken_loops() -> dict[str, Picture]:
    """Open 100 of 247 valves on a 9600 bit/s loop, unbroken or, with four kinds of master, broken.

    The loop breaks in its middle after 12 s; a run takes 60 s.
    """
    cases = {"no break": System(MAX_UNIT, status_poll(9600))}
    for move, timeout in product(MOVES, (1.0, 0.1)):
        name = f"{'one by one' if move == 'slave' else 'all downstream'}, time-out {timeout:g} s"
        cases[name] = System(MAX_UNIT, status_poll(9600, timeout=timeout), move=move)
    orders = [Command("open", 3.0, valves=range(1, 101))]
    pictures = {}
    for name, system in cases.items():
        faults = [] if name == "no break" else [Break(MAX_UNIT // 2, start=12.0)]
        plant = Plant(system)
        pictures[name] = Picture(operate(plant, orders, until=60.0, faults=faults), plant)
    return pictures


def picture_table(pictures: Mapping[str, Picture]) -> pd.DataFrame:
    """Return the greatest age and counts of unanswered requests and wrong valves per picture."""
    rows = {}
    for name, (seen, plant) in pictures.items():
        screen = seen.screen().table()
        # A position is wrong if it is unknown, too.
        near = np.abs(screen["position_percent"] - 100 * plant.opening) <= NEAR
        rows[name] = {
            "oldest_s": seen.oldest,
            "unanswered": sum(not answered for *_, answered in seen.tries),
            "shown_moving": int((screen["state"] == "moving").sum()),
            "moving": int(plant.running.sum()),
            "wrong": int((~near).sum()),
        }
    return pd.DataFrame.from_dict(rows, orient="index")
