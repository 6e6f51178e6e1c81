"""A redundant Modbus line that forms a loop: reachable slaves and longest gaps."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from shipnet import style
from shipnet.arrays import Floats
from shipnet.clock import Fault, as_faults
from shipnet.errors import ArgumentError
from shipnet.fields import check_fields, check_whole, choice, number, part, record, switch, whole
from shipnet.lazy import Axes, pd
from shipnet.modbus.faults import Break, DeadPort, DeadSlave, Short
from shipnet.modbus.frame import MAX_UNIT
from shipnet.modbus.polling import Poll

#: Marker, colour and label of slaves, by the port that serves them.
_SERVED = {
    "A": ("o", style.FIELD["address"], "through A"),
    "B": ("s", style.FIELD["information"], "through B"),
    "-": ("X", "0.75", "lost"),
}

_NUMBERED = 40  #: Larger numbers of slaves are drawn without labels.

#: One fault of a redundant line, or several.
Faults = Fault | Iterable[Fault]


def line_faults(faults: Faults) -> tuple[Fault, ...]:
    """Return faults as a tuple, or raise an error if a redundant line cannot have one of them."""
    return as_faults(faults, Break, Short, DeadSlave, DeadPort)


@dataclass(frozen=True, slots=True)
class Reach:
    """The slaves that each port of a master reaches.

    Port A reaches slaves 1 to `last_a`, and port B slaves `first_b` to `n_slaves`, in both cases
    without the `dead` ones.
    """

    n_slaves: int
    last_a: int
    first_b: int
    dead: frozenset[int] = frozenset()

    @property
    def through_a(self) -> list[int]:
        """Slaves that port A reaches."""
        return [s for s in range(1, self.last_a + 1) if s not in self.dead]

    @property
    def through_b(self) -> list[int]:
        """Slaves that port B reaches."""
        return [s for s in range(self.first_b, self.n_slaves + 1) if s not in self.dead]

    @property
    def lost(self) -> list[int]:
        """Slaves that neither port reaches."""
        return [s for s, port in enumerate(self.served, start=1) if port == "-"]

    @property
    def served(self) -> list[str]:
        """Port that serves each slave: A if both ports reach it, ``"-"`` if neither does."""
        a, b = set(self.through_a), set(self.through_b)
        slaves = range(1, self.n_slaves + 1)
        return ["A" if s in a else "B" if s in b else "-" for s in slaves]


@record(slots=True)
class Loop:
    r"""A line from port A of a master past all slaves and, if closed, back to its port B.

    Notes
    -----
    From kim2014, sections 2.1 and 3: two-wire RS-485, slaves with one port, and a master with two
    ports that uses the other direction when the line is broken. The paper gives no rule for the
    switch-over: `move` and `recheck` are assumptions. We also assume that a dead slave or port does
    not disturb the line, that all slaves are polled through A while the line is intact, that there
    is one transaction at a time, that a section both broken and shorted is shorted on both sides of
    the break, and that termination remains adequate. The paper gives 256 as the maximum number of
    slaves, but 250 in its specification of the master; the standard allows 247.

    With s slaves that stay on their port, m that are moved and l that are lost, a time T for an
    answered poll and G for one that times out, including its retries, the longest gap is

    .. math:: t = s T + m (G + T) + 2 l G, \qquad t = (s + m) T + G + 2 l G

    if slaves are moved one by one (left), or all downstream of the first are moved with it (right).
    In the second case the gap is one G longer for all moved slaves but the last, and one G shorter
    if no slave is moved. On an open line a lost slave costs G instead of 2 G. The worst moment for
    a fault is the end of the slave's response; gaps of these lengths can then occur.

    Examples
    --------
    >>> from shipnet.modbus import Poll, Request, SerialLine
    >>> from shipnet.modbus.faults import Break, Short
    >>> poll = Poll(Request.read_input_registers(0, 4), SerialLine(9600), timeout=0.5)
    >>> loop = Loop(5, poll)
    >>> loop.reach(Break(2)).through_b, loop.reach([Break(2), Break(4)]).lost
    ([3, 4, 5], [3, 4])
    >>> len(loop.reach(Short(2)).lost), Loop(5, poll, closed=False).reach(Break(2)).lost
    (5, [3, 4, 5])
    >>> loop.single_failures().groupby("kind", sort=False)["lost"].max().to_dict()
    {'break': 0, 'short': 5, 'slave': 1, 'port': 0}

    A loop of ten valves breaks in the middle. Either each slave beyond the break times out by
    itself, or all of them are moved after the first time-out:

    >>> Loop(10, poll).worst_gap(Break(5)).max().round(2).item()
    2.87
    >>> Loop(10, poll, move="downstream").worst_gap(Break(5)).max().round(2).item()
    1.34
    """

    n_slaves: int = whole(1, MAX_UNIT, help="Number of slaves; slave 1 is next to port A")
    poll: Poll = part(Poll, "Request sent to each slave")
    closed: bool = switch(
        "Whether the line continues from the last slave to port B; if not, the master has only "
        "port A",
        default=True,
        kw_only=True,
    )
    isolators: bool = switch(
        "Whether a short disables only its section, like a break; without isolators it silences "
        "every slave and port connected to it",
        default=False,
        kw_only=True,
    )
    move: Literal["slave", "downstream"] = choice(
        ("slave", "downstream"),
        "Which slaves move to the other port if a poll and its retries "
        "get no response: only the silent slave, or also all downstream of it on the same port. A "
        "slave that is silent on the other port too is lost and no longer polled",
        default="slave",
        kw_only=True,
    )
    recheck: float = number(
        1e-3,
        1e6,
        "s",
        "Time from the last failed attempt until the master tries the next slave "
        "that is lost or served through B; at least the time of a scan. The master sends one "
        "request through A, without retries, and if a lost slave does not answer, one through B. "
        "A slave that answers through A stays there; the next is tried in the same scan",
        default=60.0,
        kw_only=True,
    )

    def __post_init__(self) -> None:
        check_fields(self)
        if self.recheck < self.period * (1 - 1e-12):
            scan = f"{self.period:g} s, a scan"
            raise ArgumentError(f"recheck is {self.recheck:g} s; it must be at least {scan}")

    @property
    def period(self) -> float:
        """Time of a scan if all slaves answer [s]."""
        return self.poll.scan_time(self.n_slaves)

    @property
    def n_sections(self) -> int:
        """Number of sections of the cable."""
        return self.n_slaves + self.closed

    def single_faults(self) -> list[Fault]:
        """Return all possible faults: first breaks, then shorts, dead slaves and dead ports."""
        sections = range(self.n_sections)
        ports: list[Fault] = [DeadPort("A"), DeadPort("B")]
        return [
            *map(Break, sections),
            *map(Short, sections),
            *map(DeadSlave, range(1, self.n_slaves + 1)),
            *ports[: 1 + self.closed],
        ]

    def reach(self, faults: Faults = ()) -> Reach:
        """Return the slaves that each port reaches while all faults exist, whatever their times."""
        n = self.n_slaves
        first_cut, last_cut, first_short, last_short = n + 1, -1, n + 2, -2
        dead: set[int] = set()
        silent: set[str] = set() if self.closed else {"B"}
        for fault in line_faults(faults):
            match fault:
                case Short(section=place) if not self.isolators:
                    check_whole("section", place, 0, self.n_sections - 1)
                    first_short, last_short = min(first_short, place), max(last_short, place)
                case Break(section=place) | Short(section=place):
                    check_whole("section", place, 0, self.n_sections - 1)
                    first_cut, last_cut = min(first_cut, place), max(last_cut, place)
                case DeadSlave(slave=slave):
                    dead.add(check_whole("slave", slave, 1, n))
                case DeadPort(port=port):
                    silent.add(port)
        # A short silences the ports that no cut separates from it.
        without_a = "A" in silent or first_short <= first_cut
        without_b = "B" in silent or last_short >= last_cut
        last_a = 0 if without_a else min(first_cut, n)
        first_b = n + 1 if without_b else max(last_cut + 1, 1)
        return Reach(n, last_a, first_b, frozenset(dead))

    def worst_gap(self, faults: Faults) -> Floats:
        """Return the longest gap between responses that the faults can cause for each slave [s].

        All faults are assumed to begin at the same time and to be permanent; their own times are
        ignored. The gap of a lost slave is infinite. The gap of a moved slave is also its longest
        switch-over time, from the fault to the next response.
        """
        served = np.array(self.reach(faults).served)
        stay, moved, lost = (int((served == port).sum()) for port in "AB-")
        silent = self.poll.timeout_time
        gap = (stay + moved) * self.poll.time + (1 + self.closed) * lost * silent
        if self.move == "slave" or moved == 0:
            return np.where(served == "-", np.inf, gap + moved * silent)
        gap += silent
        longest: Floats = np.select([served == "A", served == "B"], [gap, gap + silent], np.inf)
        longest[np.flatnonzero(served == "B")[-1]] = gap
        return longest

    def single_failures(self) -> pd.DataFrame:
        """Return the worst effect of each fault, one row per ``fault``.

        ``kind`` is break, short, slave or port; ``served_a``, ``served_b`` and ``lost`` count
        slaves; ``worst_gap_s`` is the longest gap of any slave still served, NaN if there is none.
        """
        rows = {}
        for fault in self.single_faults():
            served, gaps = self.reach(fault).served, self.worst_gap(fault)
            rows[str(fault)] = {
                "kind": str(fault).split()[0],
                "served_a": served.count("A"),
                "served_b": served.count("B"),
                "lost": served.count("-"),
                "worst_gap_s": max(gaps[np.isfinite(gaps)], default=np.nan),
            }
        return pd.DataFrame.from_dict(rows, orient="index").rename_axis("fault")

    @style.applied
    def plot(self, faults: Faults = (), ax: Axes | None = None) -> Axes:
        """Draw the loop, its faults, and the port that serves each slave; return the axes.

        A break is a dotted section, a short a thick one, and a dead slave or port a cross.
        """
        ax = style.axes(ax)
        failed = line_faults(faults)
        served = self.reach(failed).served
        n = self.n_slaves
        # From port A on the left, over the top, to port B on the right of the master.
        angle = np.linspace(-0.6 * np.pi, -2.4 * np.pi, n + 2)
        x, y = np.cos(angle), np.sin(angle)
        cables = [f for f in failed if isinstance(f, Break | Short)]
        broken, shorted = (
            {f.section for f in cables if isinstance(f, kind)} for kind in (Break, Short)
        )
        red = style.LIMIT["color"]
        for k in range(self.n_sections):
            arc = np.linspace(angle[k], angle[k + 1], 12)
            bad = k in broken | shorted
            ax.plot(
                np.cos(arc),
                np.sin(arc),
                zorder=4 if bad else 1,
                color=red if bad else "0.3",
                linestyle=":" if k in broken else "-",
                linewidth=4 if k in shorted else 1.5,
            )
            if bad:
                words = "\n".join(str(f) for f in cables if f.section == k)
                at = 1.1 * np.cos(arc[6]), 1.1 * np.sin(arc[6])
                ax.text(*at, words, color=red, ha="left" if at[0] > 0 else "right", va="center")
        for port, (marker, colour, words) in _SERVED.items():
            served_here = np.flatnonzero(np.array(served) == port) + 1
            if served_here.size:
                ax.plot(
                    x[served_here],
                    y[served_here],
                    marker,
                    color=colour,
                    markersize=14 if n <= _NUMBERED else 4,
                    label=f"{served_here.size} {words}",
                    zorder=2,
                )
        if n <= _NUMBERED:
            for s in range(1, n + 1):
                ax.text(x[s], y[s], str(s), ha="center", va="center", zorder=3)
        ax.bar(0, 0.26, 0.84, bottom=y[0] - 0.16, color="white", edgecolor="0.2", zorder=3)
        ax.text(0, y[0] - 0.03, "master", ha="center", va="center", zorder=5)
        for s, port in ((0, "A"), (n + 1, "B"))[: 1 + self.closed]:
            ax.text(x[s], y[s] - 0.03, port, ha="center", va="center", fontweight="bold", zorder=5)
        dead = [f.slave for f in failed if isinstance(f, DeadSlave)]
        dead += [0 if f.port == "A" else n + 1 for f in failed if isinstance(f, DeadPort)]
        if dead:
            ax.plot(x[dead], y[dead], "x", color=red, markersize=14, zorder=6)
        ax.legend(loc="center", markerscale=0.7)
        ax.set(xlim=(-1.35, 1.35), ylim=(-1.25, 1.25), aspect="equal")
        ax.set_axis_off()
        return ax
