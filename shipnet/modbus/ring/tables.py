"""Every fault, and every pair of faults: who is reached, and how long data stay away."""

from __future__ import annotations

from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from shipnet.fields import check_whole
from shipnet.modbus.ring.bounds import System
from shipnet.modbus.ring.channels import Channels
from shipnet.modbus.ring.faults import Break, DeadPort, DeadSlave, Fault, Short

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pandas as pd

__all__ = ["fault_pairs", "fault_table", "single_faults"]


def single_faults(system: System) -> list[Fault]:
    """Return everything that can fail, one by one, each from time 0 on.

    Parameters
    ----------
    system : Loop or Channels
        What fails.

    Returns
    -------
    list of Fault
        A break and a short of every section, then every slave, then both ports.

    Examples
    --------
    >>> from shipnet.modbus.ring.loop import Loop
    >>> from shipnet.modbus.timing import Poll, Serial
    >>> [str(fault) for fault in single_faults(Loop(1, Poll(Serial(9600), 8, 13)))]
    ['break 0', 'break 1', 'short 0', 'short 1', 'slave 1', 'port A', 'port B']
    """
    sections = range(system.n_sections)
    n_slaves = 2 if isinstance(system, Channels) else system.n_slaves
    return [
        *map(Break, sections),
        *map(Short, sections),
        *map(DeadSlave, range(1, n_slaves + 1)),
        DeadPort("A"),
        DeadPort("B"),
    ]


def fault_pairs(system: System) -> list[tuple[Fault, Fault]]:
    """Return every two different faults of `single_faults`, both from time 0 on.

    Parameters
    ----------
    system : Loop or Channels
        What fails.

    Returns
    -------
    list of tuple of Fault
        The pairs, each once.

    Examples
    --------
    >>> from shipnet.modbus.ring.loop import Loop
    >>> from shipnet.modbus.timing import Poll, Serial
    >>> len(fault_pairs(Loop(1, Poll(Serial(9600), 8, 13))))
    21
    """
    return list(combinations(single_faults(system), 2))


def fault_table(system: System, *, order: int = 1) -> pd.DataFrame:
    """Return what every fault, or every pair of faults, does at worst.

    Parameters
    ----------
    system : Loop or Channels
        A master with two ports.
    order : {1, 2}, default 1
        How many faults at once: the table of 247 slaves has 745 rows for one and 277 140 for two.

    Returns
    -------
    pandas.DataFrame
        One row a case: ``fault``, or ``first`` and ``second``; how many slaves are served through
        each port, ``served_a`` and ``served_b``, A where both reach a slave; how many are
        ``lost``; ``worst_gap_s``, the longest time between two answers of any slave that is still
        served, NaN if there is none.

    Raises
    ------
    ArgumentError
        If `order` is neither 1 nor 2.

    Examples
    --------
    >>> from shipnet.modbus.ring.loop import Loop
    >>> from shipnet.modbus.timing import Poll, Serial
    >>> table = fault_table(Loop(3, Poll(Serial(9600), 8, 13)))
    >>> table.query("fault in ['break 1', 'short 1', 'slave 2']").round(2).values.tolist()
    [['break 1', 1, 2, 0, 2.11], ['short 1', 0, 0, 3, nan], ['slave 2', 2, 0, 1, 2.08]]
    """
    import pandas as pd

    check_whole("order", order, 1, 2)
    faults = single_faults(system)
    rows = np.arange(len(faults))
    places = [rows] if order == 1 else list(np.triu_indices(len(faults), 1))
    cases: Sequence[Sequence[Fault]]
    cases = [[fault] for fault in faults] if order == 1 else fault_pairs(system)
    stay, moved = _counts(system, cases)
    lost = system.n_slaves - stay - moved
    staying, moving, last = system.gaps(stay, moved, lost)
    # Those that are moved wait longer than those that stay.
    worst = np.select([moved > 1, moved == 1, stay > 0], [moving, last, staying], np.nan)
    labels = [str(fault) for fault in faults]
    names = ["fault"] if order == 1 else ["first", "second"]
    columns: dict[str, object] = {
        name: labels if order == 1 else pd.Categorical.from_codes(place, pd.Index(labels))
        for name, place in zip(names, places, strict=True)
    }
    columns |= {"served_a": stay, "served_b": moved, "lost": lost, "worst_gap_s": worst}
    return pd.DataFrame(columns)


def _counts(
    system: System, cases: Sequence[Sequence[Fault]]
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Return how many slaves are served through A, and how many through B only."""
    last_a, first_b = system.spans(cases)
    begin_b = np.maximum(first_b, last_a + 1)
    stay, moved = last_a.copy(), system.n_slaves + 1 - begin_b
    if isinstance(system, Channels):
        return stay, moved
    # Dead slaves of one case are different ones, for no fault is in it twice.
    number = {id(f): f.slave for case in cases for f in case if isinstance(f, DeadSlave)}
    for place in range(len(cases[0])):
        dead = np.array([number.get(id(case[place]), 0) for case in cases])
        stay -= (dead > 0) & (dead <= last_a)
        moved -= dead >= begin_b
    return stay, moved
