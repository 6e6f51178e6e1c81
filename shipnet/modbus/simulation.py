"""A simulated master with two ports on a line with faults: its polls and switch-overs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import inf

import numpy as np

from shipnet import style
from shipnet.answers import Utilisation
from shipnet.arrays import Bools, Floats, Integers
from shipnet.clock import Fault
from shipnet.fields import check_scalar
from shipnet.html import as_html
from shipnet.lazy import Axes, pd
from shipnet.modbus.faults import Break, Short
from shipnet.modbus.frame import MAX_UNIT
from shipnet.modbus.redundancy import Faults, Loop, line_faults

A, B, LOST = range(3)  #: Ports, or none.

#: Kinds of try: in turn, at once on the other port, or to recheck a lost or moved slave.
KINDS = ("poll", "switch", "probe")
_POLL, _SWITCH, _PROBE = range(3)

Try = tuple[float, int, int, int, bool]  #: Start [s], slave counted from 0, port, kind, answered.


class Paths:
    """Which slaves each port reaches, for each interval in which no fault begins or ends."""

    def __init__(self, system: Loop, faults: Sequence[Fault]) -> None:
        system.reach(faults)
        edges = {f.start for f in faults} | {f.stop for f in faults}
        starts = [0.0, *sorted(edge for edge in edges if 0 < edge < inf)]
        self.ends = [*starts[1:], inf]
        self.joined: list[tuple[list[bool], list[bool]]] = []
        for start in starts:
            reach = system.reach([f for f in faults if f.start <= start < f.stop])
            ports = ({*reach.through_a}, {*reach.through_b})
            a, b = ([s in port for s in range(1, system.n_slaves + 1)] for port in ports)
            self.joined.append((a, b))
        self.piece = 0

    def hold(self, start: float, end: float, slave: int, port: int) -> bool:
        """Return whether a path is intact from `start` to `end`; `start` must not decrease."""
        while self.ends[self.piece] <= start:
            self.piece += 1
        piece = self.piece
        while self.joined[piece][port][slave]:
            if self.ends[piece] >= end:
                return True
            piece += 1
        return False


class Master:
    """A master that applies the switch-over rule in simulated time."""

    def __init__(self, system: Loop, faults: Sequence[Fault]) -> None:
        n = system.n_slaves
        self.rule, self.n = system, n
        self.attempts = 1 + system.poll.retries
        self.answered, self.unanswered = system.poll.time, system.poll.unanswered_time
        self.needed = system.poll.time - system.poll.line.t35
        self.paths = Paths(system, faults)
        self.port = [A] * n
        self.time, self.last_failure, self.probed = 0.0, -inf, n - 1
        self.tries: list[Try] = []

    def run(self, end: float) -> list[Try]:
        """Scan until `end` [s], the end of the simulation, and return the tries."""
        while self.time < end:
            self.scan(end)
        return self.tries

    def scan(self, end: float) -> None:
        """Give each slave its turn; no turn begins at or after the end of the simulation."""
        begin = self.time
        for slave in range(self.n):
            if self.time >= end:
                break
            self.turn(slave)
        if self.time == begin:
            # If all slaves are lost, nothing happens before the next recheck.
            self.time = min(self.last_failure + self.rule.recheck, end)

    def turn(self, slave: int) -> None:
        """Poll or recheck one slave, as the rule requires."""
        port = self.port[slave]
        if port != A and self.due(slave):
            self.probed = slave
            if self.attempt(slave, A, _PROBE):
                self.port[slave] = A
                return
            if port == LOST and self.rule.closed and self.attempt(slave, B, _PROBE):
                self.port[slave] = B
                return
        if port == LOST or self.ask(slave, port, _POLL):
            return
        other = B if port == A else A
        if not (self.rule.closed and self.ask(slave, other, _SWITCH)):
            self.port[slave] = LOST
            return
        self.port[slave] = other
        if self.rule.move == "downstream":
            downstream = range(slave + 1, self.n) if port == A else range(slave)
            for one in downstream:
                if self.port[one] == port:
                    self.port[one] = other

    def due(self, slave: int) -> bool:
        """Return whether a recheck is due and it is this slave's turn."""
        if self.time < self.last_failure + self.rule.recheck:
            return False
        following = ((self.probed + step) % self.n for step in range(1, self.n + 1))
        return slave == next(one for one in following if self.port[one] != A)

    def ask(self, slave: int, port: int, kind: int) -> bool:
        """Poll a slave, with retries if necessary; return whether it responded."""
        left = self.attempts
        while left and not self.attempt(slave, port, kind):
            left -= 1
        return left > 0

    def attempt(self, slave: int, port: int, kind: int) -> bool:
        """Send one request and advance the clock; return whether it was answered."""
        start = self.time
        answered = self.paths.hold(start, start + self.needed, slave, port)
        self.tries.append((start, slave, port, kind, answered))
        if answered:
            self.time = start + self.answered
        else:
            self.time = self.last_failure = start + self.unanswered
        return answered


@dataclass(frozen=True, eq=False, repr=False)
class Run:
    """A simulated run of a master, returned by `simulate` for `system`, `faults` and `until` [s].

    Examples
    --------
    >>> from shipnet.modbus import Loop, Poll, Request, SerialLine, simulate
    >>> poll = Poll(Request.read_input_registers(0, 4), SerialLine(9600), timeout=0.1)
    >>> simulate(Loop(3, poll), until=1.0)
    Run(3 slaves, no faults, 32 tries in 1 s, longest gap 0.0963 s)
    """

    system: Loop
    faults: tuple[Fault, ...]
    until: float
    tries: list[Try]
    _ports: list[int]

    def __repr__(self) -> str:
        n = self.system.n_slaves
        return (
            f"Run({n} slave{'s'[: n > 1]}, {', '.join(map(str, self.faults)) or 'no faults'}, "
            f"{len(self.tries)} tries in {self.until:g} s, longest gap {self.gaps.max():.3g} s)"
        )

    def _repr_html_(self) -> str:
        rows = self.table().sort_values("longest_gap_s", ascending=False, kind="stable")
        return as_html(self, rows, figure=len(self.tries) <= 500)

    def events(self) -> pd.DataFrame:
        """Return one row per try: ``start_s``, ``end_s`` (when the next may begin), ``slave``, ``port``.

        ``kind`` is poll, switch (the other port is tried at once) or probe (a slave that is lost or
        served through B is tried again), and ``answered`` says whether the whole response arrived.
        """  # noqa: E501
        start, slave, port, kind, answered = self._columns
        poll = self.system.poll
        return pd.DataFrame(
            {
                "start_s": start,
                "end_s": start + np.where(answered, poll.time, poll.unanswered_time),
                "slave": slave + 1,
                "port": np.array(["A", "B"])[port],
                "kind": np.array(KINDS)[kind],
                "answered": answered,
            }
        )

    @cached_property
    def _columns(self) -> tuple[Floats, Integers, Integers, Integers, Bools]:
        start, *whole = np.array(self.tries, float).reshape(-1, 5).T
        slave, port, kind, answered = np.array(whole, int)
        return start, slave, port, kind, answered == 1

    @cached_property
    def _answers(self) -> tuple[Floats, Integers]:
        """End times and slaves of the responses, grouped by slave."""
        start, slave, _, _, answered = self._columns
        order = np.flatnonzero(answered)
        order = order[np.argsort(slave[order], kind="stable")]
        poll = self.system.poll
        return start[order] + poll.time - poll.line.t35, slave[order]

    @cached_property
    def gaps(self) -> Floats:
        """Each slave's longest time between two responses, or from the last one to the end [s]."""
        time, slave = self._answers
        last = np.flatnonzero(np.diff(slave, append=-1))
        longest = np.full(self.system.n_slaves, self.until)
        longest[slave[last]] = self.until - time[last]
        # The last response may end after the end of the simulation.
        np.maximum(longest, 0.0, out=longest)
        within = np.flatnonzero(slave[1:] == slave[:-1])
        np.maximum.at(longest, slave[within], time[within + 1] - time[within])
        return longest

    def table(self) -> pd.DataFrame:
        """Return one row per slave: port, number of responses, longest time without a response.

        ``port`` is the port that serves the slave at the end, or ``"-"`` if the slave is lost.
        """
        n = self.system.n_slaves
        return pd.DataFrame(
            {
                "port": np.array(["A", "B", "-"])[self._ports],
                "answers": np.bincount(self._answers[1], minlength=n),
                "longest_gap_s": self.gaps,
            },
            index=pd.RangeIndex(1, n + 1, name="slave"),
        )

    def utilisation(self, update: float) -> Utilisation:
        """Return the line's utilisation if all points must be read every `update` seconds."""
        check_scalar("update", update, "s", 1e-6, 1e6)
        events, poll = self.events(), self.system.poll
        good = events[events["answered"]]
        request = poll.line.frame_time(poll.request_size)
        busy = request * len(events) + (poll.on_wire - request) * len(good)
        capacity = max(self.system.n_slaves / MAX_UNIT, float(self.gaps.max()) / update)
        worst = (good["end_s"] - good.groupby("slave")["start_s"].shift()).max()
        return Utilisation(busy / float(events["end_s"].max()), capacity, float(worst))

    @style.applied
    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the frames at both ports; return the axes.

        After a request without a response, the wait until the time-out is hatched.
        """
        ax, red = style.axes(ax), style.LIMIT["color"]
        polls, poll = self.events(), self.system.poll
        request = poll.line.frame_time(poll.request_size)
        response = poll.line.frame_time(poll.response_size)
        for row, port in ((1.0, "A"), (0.0, "B")):
            tries = polls[polls["port"] == port]
            first, answered = tries["start_s"].to_numpy(), tries["answered"].to_numpy()
            answers = first[answered] + poll.time - poll.line.t35 - response
            for name, colour, begins, length, height in (
                ("request", "C0", first, request, 0.6),
                ("response", "C5", answers, response, 0.6),
                ("no response", "white", first[~answered] + request, poll.timeout, 0.2),
            ):
                bars, label = [(at, length) for at in begins], name if port == "A" else f"_{name}"
                bar = ax.broken_barh(bars, (row, height), facecolor=colour, label=label)
                if name == "no response":
                    bar.set(edgecolor=red, hatch="/////")
        for fault in self.faults:
            words = str(fault)
            if isinstance(fault, Break | Short):
                place = f"after slave {fault.section}" if fault.section else "at port A"
                words = f"{type(fault).__name__.lower()} {place}"
            for at, text in ((fault.start, words), (fault.stop, f"{words}: repaired")):
                if at <= self.until:
                    ax.axvline(at, color=red, linestyle=style.LIMIT["linestyle"], linewidth=1)
                    side = "left" if at < self.until / 2 else "right"
                    ax.annotate(f" {text} ", (at, 1.75), color=red, ha=side, va="center")
        ax.set_yticks([1.3, 0.3], labels=["port A", "port B"])
        ax.set(xlabel="time [s]", xlim=(0, self.until), ylim=(-0.2, 1.95))
        style.legend(ax)
        return ax


def simulate(system: Loop, *, faults: Faults = (), until: float) -> Run:
    """Simulate a master that polls its slaves through either port.

    Parameters
    ----------
    system : Loop
        The line; at the start all slaves are served through port A.
    faults : Fault or iterable of Fault, optional
        Faults from `faults`: `Break`, `Short`, `DeadSlave` and `DeadPort`.
    until : float
        End of the simulation, 0..1e5 [s]; a slave's turn that has begun is completed.

    Returns
    -------
    Run
        The tries and their outcomes.

    Notes
    -----
    A try is answered if slave and port are connected from the start of the request to the end of
    the response.

    Examples
    --------
    A loop of two slaves breaks between them:

    >>> from shipnet.modbus import Loop, Poll, Request, SerialLine
    >>> from shipnet.modbus.faults import Break
    >>> poll = Poll(Request.read_holding_registers(0, 99), SerialLine(9600), timeout=0.3)
    >>> run = simulate(Loop(2, poll), faults=Break(1, start=0.1), until=1)
    >>> run.events().round(3)[["start_s", "port", "kind", "answered"]].values.tolist()[:3]
    [[0.0, 'A', 'poll', True], [0.25, 'A', 'poll', False], [0.559, 'B', 'switch', True]]
    >>> run.table()["port"].tolist()
    ['A', 'B']
    """
    end = check_scalar("until", until, "s", 0, 1e5)
    failed = line_faults(faults)
    master = Master(system, failed)
    return Run(system, failed, end, master.run(end), master.port)
