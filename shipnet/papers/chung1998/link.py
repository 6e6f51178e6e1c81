"""Sections 3, 4 and 5: turns, cycle, supervision, and switches that are there twice."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from shipnet.fields import check_whole
from shipnet.papers.chung1998.integrity import PATIENCE
from shipnet.papers.chung1998.packets import ITEMS
from shipnet.papers.chung1998.stations import PRINTED
from shipnet.papers.registry import check, numeric
from shipnet.remote_control.link.cascade import cascade
from shipnet.remote_control.link.faults import Dead, LostPacket
from shipnet.remote_control.link.run import simulate
from shipnet.remote_control.link.supervision import Supervision
from shipnet.remote_control.link.system import BIT_RATES, System
from shipnet.remote_control.link.timing import cycle_time as cycle_of
from shipnet.remote_control.link.timing import quiet_time
from shipnet.remote_control.link.trials import switch_trials
from shipnet.remote_control.packet import Markers

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["as_printed", "cascade_table", "deaths_table"]

#: Section 4: period of the timer [s], and the limits of the two counters.
_TICK = float(PRINTED["tick"])
_COUNT, _MISS = (int(PRINTED[f"{name}_threshold"]) for name in ("count", "miss"))


def as_printed(rate: float = BIT_RATES[0], items: int = ITEMS, bits: int = 10) -> System:
    """Return the link of the paper, in reading A, with all data in every packet.

    Parameters
    ----------
    rate : float, optional
        Bit rate [bit/s].
    items : int, optional
        Data a packet.
    bits : int, default 10
        Bits of a character on the line; the paper names none.

    Returns
    -------
    System
        The link.

    Examples
    --------
    >>> link = as_printed(600)
    >>> link.n_items, link.repeat
    (10, 10)
    """
    form = Markers(n_numbers=items)
    return System(form, bit_rate=rate, character_bits=bits, repeat=items)


@numeric("chung1998-003")
def cycle_time(*, rate: float = 9600.0, items: int = ITEMS, bits: int = 10) -> float:
    """Seconds of one exchange with BCS and one with SS, nothing but bytes counted."""
    return cycle_of(as_printed(rate, items, bits))


@check("chung1998-040", counter={"master": "BCS"})
def master_asks_in_turn(*, master: str = "RCS") -> bool:
    """Whether this station begins every exchange, and the two others answer in turn."""
    run = simulate(as_printed(), 1.0)
    hops = [(packet.source, packet.target) for packet in run.packets[:16]]
    asks, answers = hops[::2], hops[1::2]
    turns = [target for _, target in asks]
    return (
        {source for source, _ in asks} == {master}
        and answers == [(target, source) for source, target in asks]
        and all(one != other for one, other in pairwise(turns))
    )


@check("chung1998-031", counter={"turn_timeout": 0.01})
def never_both_send(*, turn_timeout: float | None = None) -> bool:
    """Whether a sender listens as soon as it is done, and no two packets overlap in time."""
    form = Markers(n_numbers=ITEMS)
    run = simulate(System(form, repeat=ITEMS, turn_timeout=turn_timeout), 1.0)
    apart = all(one.end <= other.start for one, other in pairwise(run.packets))
    listening = run.states.query("state == 'receiving' and time_s > 0")
    ends = [packet.end for packet in run.packets if packet.end <= run.duration]
    return apart and listening["time_s"].tolist() == ends


@numeric("chung1998-007", "chung1998-045")
def failure_time(*, count: int = _COUNT, miss: int = _MISS, tick: float = _TICK) -> float:
    """Seconds until a partner is taken as failed, by the tests as printed."""
    return Supervision(tick, count, miss).detection_time[1]


@check("chung1998-043", counter={"readings": ("A",)})
def sign_of_life_is_enough(*, readings: tuple[Literal["A", "B"], ...] = ("A", "B")) -> bool:
    """Whether a healthy link in which nothing changes raises no alarm, its packet read so."""
    idle = (System(Markers(reading, ITEMS)) for reading in readings)
    return all(len(simulate(system, 8.0).alarms) == 0 for system in idle)


@check("chung1998-044", counter={"miss": 99})
def nobody_waits_for_ever(*, miss: int = _MISS) -> bool:
    """Whether, after either partner died, whoever waits for it goes on within 20 s."""
    rule = Supervision(_TICK, _COUNT, miss)
    form = Markers(n_numbers=ITEMS)
    system = System(form, repeat=ITEMS, master=rule, slave=rule)
    missed = set()
    for dead in ("RCS", "BCS", "SS"):
        alarms = simulate(system, 21.0, faults=[Dead(dead, 1.0)]).alarms
        missed |= set(zip(alarms["station"], alarms["partner"], strict=True))
    return missed >= {("BCS", "RCS"), ("SS", "RCS"), ("RCS", "BCS"), ("RCS", "SS")}


@numeric("chung1998-046")
def longest_silence(*, rate: float = 600.0, items: int = ITEMS, bits: int = 10) -> float:
    """Seconds without a 0xDD that a slave sees in health."""
    return quiet_time(as_printed(rate, items, bits))


@numeric("chung1998-047")
def silence_while_waiting(*, rate: float = 9600.0, items: int = ITEMS) -> float:
    """Seconds without a 0xDD for BCS while RCS waits for an SS that died silent, as printed."""
    return cascade(as_printed(rate, items)).quiet[1]


def cascade_table(
    mends: Mapping[str, Mapping[str, Any]], rates: Sequence[float] = (9600, 600)
) -> pd.DataFrame:
    """Return what BCS sees while RCS waits for a dead SS, as printed or mended.

    Parameters
    ----------
    mends : mapping of str to mapping
        Name of each rule, and the fields of `System` that it changes.
    rates : sequence of float, optional
        Bit rates [bit/s].

    Returns
    -------
    pandas.DataFrame
        A row a rule and bit rate: ``rule``, ``bit/s``, ``RCS waits [s]`` and ``BCS hears nothing
        [s]`` at the first turn of an SS that died silent, as the timers stand at worst, ``later,
        up to [s]`` for any moment of death and any turn, and ``false alarm`` of BCS: never,
        possible or certain.

    Raises
    ------
    ArgumentError
        If `System` does not take the fields.

    Examples
    --------
    >>> cascade_table({"as printed": {}})["false alarm"].tolist()
    ['possible', 'certain']
    """
    import pandas as pd

    rows = []
    for name, fields in mends.items():
        for rate in rates:
            seen = cascade(replace(as_printed(rate), **fields))
            rows.append((name, rate, seen.wait[1], seen.quiet[1], seen.longest, seen.alarm))
    columns = ["rule", "bit/s", "RCS waits [s]", "BCS hears nothing [s]", "later, up to [s]"]
    columns += ["false alarm"]
    return pd.DataFrame(rows, columns=columns)


def deaths_table(
    mends: Mapping[str, Mapping[str, Any]], rate: float = 600, n: int = 30
) -> pd.DataFrame:
    """Return who is taken as failed when SS dies, its deaths spread over a cycle.

    Parameters
    ----------
    mends : mapping of str to mapping
        Name of each rule, and the fields of `System` that it changes.
    rate : float, default 600
        Bit rate [bit/s].
    n : int, default 30
        How many deaths, 1..1000; the timers of the stations stand by chance, seed 2024.

    Returns
    -------
    pandas.DataFrame
        A row a rule: ``rule``, ``deaths``, and in how many of these ``RCS fails SS``, which is
        right, ``RCS fails BCS`` and ``BCS fails RCS``, which are not.

    Raises
    ------
    ArgumentError
        If `System` does not take the fields, or an argument is out of range.

    Examples
    --------
    >>> deaths_table({"a turn ends": {"turn_timeout": 1.0}}, n=3).iloc[0].astype(str).tolist()
    ['a turn ends', '3', '3', '0', '0']
    """
    import pandas as pd

    pairs = (("RCS", "SS"), ("RCS", "BCS"), ("BCS", "RCS"))
    runs, rows = check_whole("n", n, 1, 1000), []
    for name, fields in mends.items():
        system = replace(as_printed(rate), **fields)
        rng, cycle, found = np.random.default_rng(2024), cycle_of(system), []
        for k in range(runs):
            # After a cycle; the last failure is found by four waits later.
            death = (1 + (k + 0.5) / runs) * cycle
            end = death + 4 * system.master.detection_time[1] + cycle
            alarms = simulate(system, end, faults=[Dead("SS", death)], rng=rng).alarms
            found.append(set(zip(alarms["station"], alarms["partner"], strict=True)))
        rows.append((name, runs, *(sum(pair in seen for seen in found) for pair in pairs)))
    columns = ["rule", "deaths", *(f"{a} fails {b}" for a, b in pairs)]
    return pd.DataFrame(rows, columns=columns)


@check("chung1998-017", counter={"all_data": False})
def speed_has_little_effect(*, all_data: bool = True, limit: float = 1.0) -> bool:
    """Whether SS follows a switch of the bridge within a second at each of the five speeds.

    With all data in every packet, or with the switch alone.
    """
    system = System(Markers(n_numbers=ITEMS), repeat=ITEMS if all_data else 0)
    table = switch_trials(np.random.default_rng(2024), system, n_changes=10)
    return bool((table["followed"] == 10).all() and (table["longest_s"] <= limit).all())


@check("chung1998-065", counter={"lost": False})
def switches_agree(*, lost: bool = True) -> bool:
    """Whether SS shows a switch of the bridge soon after it moved, if a packet is lost.

    Soon is as long as a partner may be silent.
    """
    faults = [LostPacket("BCS", "RCS", 1.0)] if lost else []
    run = simulate(
        System(Markers(n_numbers=ITEMS)), 12.0, faults=faults, changes=[(1.0, "BCS", 1, 1)]
    )
    return bool((run.delays("SS")["delay_s"] <= PATIENCE).all())
