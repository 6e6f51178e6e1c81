"""Abstract, sections 1, 3.2, 3.3, 3.5 and 3.6: why a ship should use AS-i, and at what price."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from shipnet import datasets
from shipnet.asi.faults import DeadSlave
from shipnet.asi.plan import Plan, read_plan
from shipnet.asi.receiver import TOLERANCE
from shipnet.asi.rules import rule_limits
from shipnet.asi.simulation import simulate
from shipnet.asi.slave import Slave
from shipnet.asi.timing import Cycle
from shipnet.asi.topologies import line
from shipnet.can.segment import Segment
from shipnet.design.comparison import compare
from shipnet.design.plant import Plant
from shipnet.lazy import pd
from shipnet.line.cable import CABLES
from shipnet.papers.registry import check, is_legal, numeric

#: Plants whose wiring is compared; four doors are our example of a small plant.
PLANTS = {
    "62 modules with 4 inputs at 300 m (section 3.3)": Plant(62, contacts=4),
    "190 valves on 14 lines at 50 m (submarine)": Plant(190, contacts=1, lines=14, distance=50),
    "4 doors at 10 m": Plant(4, contacts=1, distance=10),
}


def margin_of(plan: Plan, wanted_cycle: float | None = None) -> float:
    """Return the smallest margin of the rules that a plan does not meet exactly at their limit."""
    margins = plan.check(wanted_cycle=wanted_cycle).worst()["margin"]
    return float(margins[margins.abs() > 1e-9].min())


@cache
def wiring(plant: Plant) -> pd.DataFrame:
    """Return cost, labour and points lost by one cut cable, hardwired and with AS-i."""
    table = compare([plant.hardwired, plant.on_asi]).table()
    return table[["total_cost_eur", "labour_h", "lost_by_cable"]]


def price_table() -> pd.DataFrame:
    """Return what AS-i costs and loses compared with hardwiring, for three plants.

    Cost and labour rest on our assumed prices and hours. The last two columns count the points that
    one cut cable disconnects.
    """
    rows = {}
    for name, plant in PLANTS.items():
        table = wiring(plant)
        left = 100 * table.loc["AS-i"] / table.loc["hardwired"]
        lost = table["lost_by_cable"].astype(int)
        rows[name] = (left["total_cost_eur"], left["labour_h"], *lost[["hardwired", "AS-i"]])
    columns = ["cost_left_percent", "labour_left_percent", "cut_hardwired", "cut_asi"]
    return pd.DataFrame.from_dict(rows, orient="index", columns=columns)


@check(
    "kim2023-109", quantity="total_cost_eur", counter={"modules": 4, "inputs": 1, "distance": 10}
)
@check("kim2023-110", quantity="labour_h", counter={"modules": 4, "inputs": 1, "distance": 10})
def needs_less(
    *, quantity: str, modules: int = 62, inputs: int = 4, distance: float | None = None
) -> float:
    """Fraction of this quantity that AS-i saves compared with hardwiring."""
    plant = Plant(modules, contacts=inputs)
    table = wiring(plant if distance is None else replace(plant, distance=distance))[quantity]
    return float(1 - table["AS-i"] / table["hardwired"])


@check("kim2023-112", counter={"limit": 0.005})
def failure_is_noticed(*, limit: float = 1.0) -> float:
    """Margin within which the master reports a dead slave in this time [s], among 31 slaves."""
    fleet = [Slave(f"{address}") for address in range(1, 32)]
    run = simulate(fleet, until=0.4, faults=DeadSlave("7", start=0.2))
    dropped = run.lists.query("list == 'LAS' and slave == '7' and not present")["time_s"].min()
    return float(1 - (dropped - 0.2) / limit)


@check("kim2023-113", counter={"label": "3"})
def a_new_slave_disturbs_nobody(*, label: str = "6") -> bool:
    """Whether all others keep their cycle while a slave with this label appears, and it joins."""
    others = [Slave(f"{address}") for address in range(1, 6)]
    newcomer = DeadSlave(label, start=0.0, stop=0.1)
    run = simulate([*others, Slave(label)], until=0.2, faults=newcomer)
    done = run.events().query("call == 'DATA_EXCHANGE' and outcome == 'ok' and time_s > 0.05")
    waits = done[done["slave"] != label].groupby("slave", observed=True)["time_s"]
    longest = waits.apply(lambda times: times.diff().max())
    joined = (done.loc[done["slave"] == label, "time_s"] > 0.1).any()
    return bool(joined and len(longest) == 5 and longest.max() < float(Cycle(6).time) * 1.01)


@check("kim2023-116", counter={"current": 0.2})
def all_slaves_work_at_300_m(*, current: float | None = None) -> float:
    """Smallest margin of the signal and voltage rules if each of 62 slaves at 300 m draws this."""
    plan = read_plan(datasets.path("synthetic_asi_plan_300m.csv"))
    if current is not None:
        plan = replace(plan, slaves=[replace(slave, current=current) for slave in plan.slaves])
    return margin_of(plan, wanted_cycle=12e-3)


@check("kim2023-117", counter={"slow": 125e3})
def faster_buses_need_better_cable(*, slow: float = 20e3, fast: float = 125e3) -> bool:
    """Whether CAN on 100 m of open AS-i cable works at the slow bit rate, not at the fast."""
    segment = Segment(100, terminator=None, cable=CABLES["as-i 1.5"])
    right = [not segment.send({1: "01001101"}, rate).wrong for rate in (slow, fast)]
    return right == [True, False]


@check("kim2023-119", counter={"cable": "N2K_MID"})
def unshielded_costs_less(*, cable: str = "ASI_FLAT", other: str = "CAN_5_0p75") -> bool:
    """Whether one cable costs less per metre than the other, by the middle of the price range."""
    prices = datasets.read("estimated_cables.csv").set_index("cable_id")
    columns = ["price_low_eur_per_m", "price_high_eur_per_m"]
    one, two = prices.loc[[cable, other], columns].astype(float).mean(axis=1)
    return bool(one < two)


@numeric("kim2023-010")
def longest_cable() -> float:
    """Longest cable of a segment [m]."""
    return float(rule_limits()["high"]["cable_length"])


@check("kim2023-128", counter={"length": 60.0})
def length_is_a_physical_limit(*, length: float = 200.0) -> float:
    """How far a cable of this length is beyond the nearest tolerance of the receiver."""
    quality = line(length, slaves=(5, length)).quality()
    even = 1 - quality.evenness.min() / TOLERANCE.evenness
    return float(np.maximum(even, quality.ringing.max() / TOLERANCE.ringing - 1))


@check("kim2023-064", counter={"units": 63})
def units_fit_on_one_line(*, units: int = 10 + 20) -> bool:
    """Whether one line has room for this many slaves and meets every rule."""
    return is_legal(line, 100, units) and line(100, units, supply=50).check().ok is True


@check("kim2023-093", counter={"masters": 3})
def submarine_can_be_built(*, masters: int = 14, slaves: int = 190, repeaters: int = 5) -> bool:
    """Whether our plan of the submarine has these numbers and meets every rule.

    With fewer masters, the slaves do not fit on the lines.
    """
    plan = read_plan(datasets.path("synthetic_asi_plan_submarine.csv"))
    numbers = len(plan.masters), len(plan.slaves), len(plan.repeaters)
    return numbers == (masters, slaves, repeaters) and plan.check().ok is True
