"""The trials of section 5 of chung1998, and the stall that it would take to overrun a ring."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar, check_whole
from shipnet.remote_control.link.faults import Stall
from shipnet.remote_control.link.run import simulate
from shipnet.remote_control.link.system import BIT_RATES, System
from shipnet.remote_control.link.timing import cycle_time, packet_time, worst_age

if TYPE_CHECKING:
    from collections.abc import Iterable

    import pandas as pd

__all__ = [
    "BYTES_PER_PRESS",
    "PAPER_EVENTS",
    "WRITE_TIME",
    "overrun_stall",
    "ring_trials",
    "switch_trials",
]

#: Longest time that a byte takes to be written into an EEPROM of the time [s]: Atmel, AT28C64B,
#: data sheet, "write cycle time 10 ms maximum". That the paper's chip is like it is assumed.
WRITE_TIME = 10e-3

#: Abnormal states that chung1998 counted in the three trials of section 5; the middle one is in
#: words: "also" normal.
PAPER_EVENTS = (0, 0, 1)

#: Bytes that one press of the Enter key stores: one integer of 16 bits; assumed.
BYTES_PER_PRESS = 2


def ring_trials(
    system: System | None = None,
    *,
    station: str = "BCS",
    presses: int = 10,
    write_time: float = WRITE_TIME,
    duration: float = 20.0,
) -> pd.DataFrame:
    """Return how often the ring is found in an abnormal state in the paper's three trials.

    Parameters
    ----------
    system : System, optional
        The link; if omitted, that of the paper with all 10 items in every packet.
    station : str, default "BCS"
        Who writes its EEPROM.
    presses : int, default 10
        How often the Enter key is pressed in the third trial, 1..10000, the writes one after
        the other.
    write_time : float, default WRITE_TIME
        Time for a byte, 0..10 [s].
    duration : float, default 20
        How long each trial is simulated [s]; the stall begins after 5 s.

    Returns
    -------
    pandas.DataFrame
        A row a trial: ``trial``, ``stall_s``, ``events`` (abnormal states, all stations),
        ``unread`` (most bytes that waited in the ring), ``alarms``, ``paper_events``.

    Raises
    ------
    ArgumentError
        If an argument is out of range, or a stall does not end within the trial.

    Notes
    -----
    The paper counted 0, 0 and 1. The one is not reproducible: it does not print the time to
    write. While the partner waits for an answer, its one packet waits in the ring. When its
    counters have run out, after 3.9 to 4.4 s, it comes again: up to three packets wait in a
    stall below 13.1 s, and the ring of 128 bytes is still in order (claims chung1998-015, 016
    and 058).

    Examples
    --------
    >>> ring_trials()[["stall_s", "events", "unread", "paper_events"]].values.tolist()
    [[0.0, 0.0, 1.0, 0.0], [0.02, 0.0, 1.0, 0.0], [0.2, 0.0, 33.0, 1.0]]
    """
    import pandas as pd

    link = System(repeat=10) if system is None else system
    byte = check_scalar("write_time", write_time, "s", 0, 10)
    most = check_whole("presses", presses, 1, 10_000)
    rows = []
    for trial, pressed, printed in (
        ("no parameter change", 0, PAPER_EVENTS[0]),
        ("parameter change", 1, PAPER_EVENTS[1]),
        (f"{most} presses of Enter", most, PAPER_EVENTS[2]),
    ):
        stall = pressed * BYTES_PER_PRESS * byte
        if 5 + stall >= duration:
            raise ArgumentError(f"duration is {duration:g} s; the stall ends at {5 + stall:g} s")
        faults = [Stall(station, 5.0, 5.0 + stall)] if stall else []
        run = simulate(link, duration, faults=faults)
        events = int(run.table["event"].str.startswith("ring").sum())
        rows.append((trial, stall, events, run.most_unread, len(run.alarms), printed))
    columns = ["trial", "stall_s", "events", "unread", "alarms", "paper_events"]
    return pd.DataFrame(rows, columns=columns)


def overrun_stall(system: System) -> tuple[float, float]:
    r"""Return how long a slave's task must stall until its ring is overrun [s].

    The stall begins at the worst moment, with a packet. RCS waits in vain, W, and comes again
    after an exchange with the other slave, until the k-th packet after the first fills the ring:

    .. math:: S = k (W + 3 P + 2 t) + (R - k L - 1) \, t_c, \quad k = \lceil R / L \rceil - 1

    with packets of L bytes, all items in them, and a ring of R.

    Parameters
    ----------
    system : System
        The link.

    Returns
    -------
    tuple of float
        Shortest and longest time, as the timer of RCS stands; equal with a ``turn_timeout``.

    Raises
    ------
    ArgumentError
        If RCS leaves out partners that have failed, or one packet fills the ring.

    Examples
    --------
    As printed, and with an RCS that gives up a turn after 0.1 s:

    >>> [round(t, 2) for t in overrun_stall(System())]
    [13.14, 13.54]
    >>> [round(t, 2) for t in overrun_stall(System(turn_timeout=0.1))]
    [0.64, 0.64]
    """
    if system.skip_turns:
        raise ArgumentError(f"skip_turns is {system.skip_turns}; it must be 0 here")
    size, ring = system.packet_format.size(system.n_items), system.ring_size
    packet, rule = packet_time(system), system.master
    rounds = -(-ring // size) - 1
    if rounds < 1:
        raise ArgumentError(f"ring_size is {ring}; it must be more than a packet of {size} bytes")
    if system.turn_timeout is None:
        # Ticks counted for this slave before the first wait shorten that wait.
        before = np.ceil((packet + system.processing) / rule.tick) * rule.tick
        longest = rounds * rule.n_ticks * rule.tick
        waits = (longest - rounds * rule.tick - before, longest)
    else:
        waits = (rounds * system.turn_timeout,) * 2
    rest = (ring - rounds * size - 1) * system.character_time
    rest += rounds * (3 * packet + 2 * system.processing)
    return float(waits[0] + rest), float(waits[1] + rest)


def switch_trials(
    rng: np.random.Generator,
    system: System | None = None,
    *,
    bit_rates: Iterable[float] = BIT_RATES,
    n_changes: int = 20,
) -> pd.DataFrame:
    """Return how soon SS follows a switch of the bridge, by bit rate.

    Parameters
    ----------
    rng : numpy.random.Generator
        Says when the switch is moved.
    system : System, optional
        The link, whose bit rate does not matter; that of the paper if omitted, in which nothing
        else changes.
    bit_rates : iterable of float, optional
        Bit rates [bit/s]; those of the paper if omitted.
    n_changes : int, default 20
        How often it is moved, 1..10000.

    Returns
    -------
    pandas.DataFrame
        A row a bit rate: ``bit_rate``, how many changes were ``followed``, ``mean_s`` and
        ``longest_s`` delay, and the ``bound_s`` of `worst_age` for packets of all items.

    Examples
    --------
    >>> table = switch_trials(np.random.default_rng(2024))
    >>> table.followed.tolist(), table[["mean_s", "bound_s"]].round(2).values[[0, 4]].tolist()
    ([20, 20, 20, 20, 20], [[0.02, 0.21], [0.3, 3.3]])
    """
    import pandas as pd

    base = System() if system is None else system
    n = check_whole("n_changes", n_changes, 1, 10_000)
    rows = []
    for rate in bit_rates:
        link = replace(base, bit_rate=rate)
        # Twice the longest delay between two changes, and up to a cycle more.
        gap = 2 * worst_age(link) + cycle_time(link) * rng.random(n)
        times = np.cumsum(gap)
        changes = [(float(t), "BCS", 1, (k + 1) % 2) for k, t in enumerate(times)]
        run = simulate(link, float(times[-1] + 2 * worst_age(link)), changes=changes)
        delay = run.delays("SS")["delay_s"]
        bound = worst_age(link)
        rows.append((rate, int(delay.notna().sum()), delay.mean(), delay.max(), bound))
    columns = ["bit_rate", "followed", "mean_s", "longest_s", "bound_s"]
    return pd.DataFrame(rows, columns=columns)
