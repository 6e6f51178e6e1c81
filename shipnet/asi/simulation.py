"""Simulate a master, its slaves and a line, telegram by telegram, and evaluate what was sent."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import NamedTuple

import numpy as np

from shipnet import style
from shipnet.answers import Utilisation
from shipnet.arguments import checked
from shipnet.arrays import Floats
from shipnet.asi.channel import (
    ATTEMPT,
    EXECUTED,
    LABELS,
    OUTCOME,
    PHASE,
    Channel,
    MasterStops,
    Record,
    Stations,
)
from shipnet.asi.faults import LineFault
from shipnet.asi.master import Command, Master, Phase, RunningMaster, check_bits
from shipnet.asi.plan import Plan
from shipnet.asi.slave import KINDS, RunningSlave, Slave
from shipnet.asi.telegram import REQUEST_BITS, RESPONSE_BITS, Call
from shipnet.asi.timing import ADDRESSES, Transaction, exchanges, transfers_values
from shipnet.clock import Fault, as_faults
from shipnet.errors import ArgumentError
from shipnet.fields import check_rng, check_scalar, check_whole, number, part, record
from shipnet.lazy import Axes, pd

# A standby master ------------------------------------------------------------------------------


@record
class Standby:
    """A second master that listens, and goes on where the first one falls silent.

    It must know the projected slaves: from the bits alone four outputs of a standard slave look
    like three of an A/B slave. Its silence must exceed the longest that a working master leaves, a
    time-out or a pause of up to 500 us; the default is our assumption, as no source gives a value.

    Raises
    ------
    ArgumentError
        If no slave is projected, or the silence is out of range.

    References
    ----------
    .. [1] "AS-Interface communication system for field networks (2)", ICN, July 2007,
       data link layer, section 1.

    Examples
    --------
    >>> Standby(Master({"5": "S-0.F"})).silence
    0.001
    """

    master: Master = part(Master, "What it becomes")
    silence: float = number(501e-6, 1e9, "s", "Silence after which it takes over", default=1e-3)

    def __post_init__(self) -> None:
        if not self.master.projected:
            raise ArgumentError("master has no projected slaves; a standby master must know them")

    def _listen(self, record: Record) -> dict[str, int]:
        """Return what it knows from the traffic of the last three cycles."""
        begins = [row for row, number in record.cycles if number >= 0]
        first = begins[max(0, len(begins) - 3)] if begins else len(record.code)
        rows = np.array(record.code[first:], dtype=np.int64)
        fine = (rows >> OUTCOME & 15 == 0) & (rows >> EXECUTED & 1 == 1)
        known = {}
        for code in rows[fine & (rows & 15 == Call.DATA_EXCHANGE)].tolist():
            label = f"{code >> 4 & 31}{KINDS[code >> 9 & 3] or ''}"
            if label in (self.master.projected or {}):
                known[label] = code >> 11 & 31
        return known


# What came of it -------------------------------------------------------------------------------


class InputChange(NamedTuple):
    """The input ports of a slave change to a value at a time [s]."""

    time: float
    slave: str
    value: int


@dataclass(frozen=True)
class Summary:
    """The numbers of a simulation that are looked at first."""

    cycles: int
    cycle_time: tuple[float, float, float]
    requests: int
    repetitions: int
    dropped: int
    lost_replies: int

    def __str__(self) -> str:
        least, mean, most = (1e3 * time for time in self.cycle_time)
        return (
            f"{self.cycles} cycles of {mean:.2f} ms ({least:.2f} to {most:.2f} ms), "
            f"{self.requests} requests in them\n"
            f"{self.repetitions} repetitions, {self.dropped} slaves dropped, "
            f"{self.lost_replies} replies to executed requests lost"
        )


#: Requests that one figure can show.
_MOST_REQUESTS = 500


@checked
@dataclass(frozen=True, repr=False)
class Run:
    """A finished simulation: what was sent, and what an analyser makes of it.

    `simulate` returns it.

    Examples
    --------
    >>> run = simulate([Slave("5"), Slave("7")], cycles=50)
    >>> run
    <Run: 50 cycles of 0.61 ms, 0 slaves dropped>
    >>> run.events().query("cycle == 0")["call"].tolist()
    ['DATA_EXCHANGE', 'DATA_EXCHANGE', 'READ_STATUS', 'READ_IO_CONFIGURATION']
    >>> run.table()[["exchanges", "failed"]].T.to_dict()
    {'5': {'exchanges': 51, 'failed': 0}, '7': {'exchanges': 51, 'failed': 0}}
    """

    #: What was sent, packed.
    record: Record
    #: When the simulation ended [bit].
    end: float
    #: The master, and the standby master behind it if that took over.
    masters: list[RunningMaster]
    #: The slaves as they are at the end.
    slaves: list[RunningSlave]
    #: What happened at the inputs.
    changes: list[InputChange]

    def __repr__(self) -> str:
        found = self.summary
        return (
            f"<Run: {found.cycles} cycles of {1e3 * found.cycle_time[1]:.2f} ms, "
            f"{found.dropped} slaves dropped>"
        )

    @property
    def master(self) -> RunningMaster:
        """Who leads at the end."""
        return self.masters[-1]

    @property
    def duration(self) -> float:
        """When the simulation ended [s]."""
        return self.end * self.record.transaction.bit_time

    @cached_property
    def _events(self) -> pd.DataFrame:
        return self.record.table()

    def events(self) -> pd.DataFrame:
        """Return all transactions, one row each.

        The columns are ``time_s``, ``cycle`` (-1 before the first), ``phase``, ``call``,
        ``address``, ``half``, ``slave``, ``request`` (14 bits), ``request_data``,
        ``response_data`` (-1 without one), ``master_pause_bit``, ``slave_pause_bit``, ``attempt``
        (0 is the first), ``outcome`` (ok, or an error class of `shipnet.errors`; silence where an
        answer was due is ``SilenceError``), ``executed``, ``executed_but_lost`` and ``standby``.
        """
        return self._events.copy()

    @cached_property
    def _exchanges(self) -> pd.DataFrame:
        """The data exchanges by slave and time, with when inputs were taken and known [s]."""
        record, bit_time = self.record, self.record.transaction.bit_time
        slave = record.field(4, 7)
        rows = np.flatnonzero(record.field(0, 4) == Call.DATA_EXCHANGE)
        rows = rows[np.argsort(slave[rows], kind="stable")]
        sampled = record.starts[rows] + REQUEST_BITS
        return pd.DataFrame(
            {
                "slave": LABELS[slave[rows]],
                "failed": record.field(OUTCOME, 4)[rows] > 0,
                "cyclic": record.field(PHASE, 3)[rows] == Phase.DATA_EXCHANGE,
                "sampled": sampled * bit_time,
                "known": (sampled + record.pauses[rows] + RESPONSE_BITS) * bit_time,
            }
        )

    def table(self) -> pd.DataFrame:
        """Return a row per slave: its data exchanges, how many failed, and its response times."""
        by = self._exchanges.groupby("slave", sort=False)["failed"]
        counts = pd.DataFrame({"exchanges": by.size(), "failed": by.sum()})
        return counts.join(self.response_times())

    def plot(
        self,
        where: str | None = None,
        start: float | None = None,
        stop: float | None = None,
        *,
        ax: Axes | None = None,
    ) -> Axes:
        """Draw requests and responses as blocks in time, one row for the master and per slave.

        `where` is a condition on the events, such as ``"phase == 'data_exchange'"``, `start` and
        `stop` are times from the start of the simulation [s]; at most 500 requests are drawn. A
        response with an error is red, and so is the place where one is missing; a repeated
        request is hatched, with its number on it.
        """
        try:
            events = self._events if where is None else self._events.query(where)
        except Exception as problem:  # pandas raises whatever its parsing meets
            raise ArgumentError(f"where is {where!r}: {problem}") from None
        ax = style.axes(ax)
        keep = events["time_s"] >= (0.0 if start is None else start)
        if stop is not None:
            keep &= events["time_s"] < stop
        shown = events[keep]
        if not 1 <= len(shown) <= _MOST_REQUESTS:
            raise ArgumentError(
                f"start and stop show {len(shown)} requests; a figure shows 1 to {_MOST_REQUESTS}"
            )
        slaves = shown.sort_values(["address", "half"], kind="stable")["slave"].unique()
        row = {slave: place + 1 for place, slave in enumerate(slaves)}
        bit_time = self.record.transaction.bit_time
        bit = 1e3 * bit_time
        for one in shown.to_dict("records"):
            begin, place = 1e3 * one["time_s"], row[one["slave"]]
            again = one["attempt"] > 0
            style.box(
                ax,
                begin,
                -0.4,
                REQUEST_BITS * bit,
                0.8,
                facecolor=style.FIELD["address"],
                edgecolor="0.3",
                linewidth=0.5,
                hatch="////" if again else None,
            )
            if again:
                ax.text(
                    begin + REQUEST_BITS * bit / 2, -0.5, str(one["attempt"]), ha="center",
                    va="bottom",
                )  # fmt: skip
            fine, pause = one["outcome"] == "ok", one["master_pause_bit"]
            if fine and pause != pause:
                continue  # a call without an answer
            # Where nothing came, the first place at which it could have come stays marked.
            heard = pause == pause
            offset = REQUEST_BITS + (pause if heard else 2.0)
            style.box(
                ax,
                begin + offset * bit,
                place - 0.4,
                RESPONSE_BITS * bit,
                0.8,
                facecolor=style.FIELD["information"] if fine else style.LIMIT["color"],
                edgecolor="0.3",
                linewidth=0.5,
                alpha=1.0 if heard else 0.35,
                linestyle="-" if heard else ":",
            )
        last = shown.iloc[-1]
        end = last["time_s"] + (REQUEST_BITS + 10 + RESPONSE_BITS) * bit_time
        ax.set(xlim=(1e3 * shown["time_s"].iloc[0] - bit, 1e3 * end), ylim=(len(row) + 0.6, -0.8))
        ax.set_yticks(range(len(row) + 1), ["master", *(f"slave {slave}" for slave in row)])
        ax.set_xlabel("time [ms]")
        ax.grid(visible=False)
        return ax

    @cached_property
    def cycle_times(self) -> Floats:
        """Length of each complete cycle, shape (n_cycles,) [s]."""
        if not self.record.cycles:
            return np.zeros(0)
        rows, numbers = np.array([*self.record.cycles, (len(self.record.start), -2)]).T
        starts = np.append(self.record.starts, self.end)[rows]
        complete = (numbers[:-1] >= 0) & (numbers[1:] == numbers[:-1] + 1)
        return np.asarray(np.diff(starts)[complete] * self.record.transaction.bit_time)

    @cached_property
    def summary(self) -> Summary:
        """The numbers that are looked at first; they count the cycles, start-up is left out."""
        times = self.cycle_times
        nan = float("nan")
        span = (times.min(), times.mean(), times.max()) if times.size else (nan, nan, nan)
        record = self.record
        cyclic = record.cycle >= 0
        lost = (record.field(OUTCOME, 4) > 0) & (record.field(EXECUTED, 1) == 1)
        return Summary(
            cycles=times.size,
            cycle_time=(float(span[0]), float(span[1]), float(span[2])),
            requests=int(cyclic.sum()),
            repetitions=int((cyclic & (record.field(ATTEMPT, 3) > 0)).sum()),
            dropped=sum(len(master.dropped) for master in self.masters),
            lost_replies=int((cyclic & lost).sum()),
        )

    @cached_property
    def lists(self) -> pd.DataFrame:
        """What entered and left the lists: ``time_s``, ``list``, ``slave``, ``present``."""
        rows = [change for master in self.masters for change in master.lists.changes]
        return pd.DataFrame(rows, columns=["time_s", "list", "slave", "present"])

    @cached_property
    def commands(self) -> pd.DataFrame:
        """What became of the host's commands: ``time_s``, ``command``, ``done``, ``outcome``."""
        rows = [
            (time, str(command), done, outcome)
            for master in self.masters
            for time, command, done, outcome in master.finished
        ]
        return pd.DataFrame(rows, columns=["time_s", "command", "done", "outcome"])

    @cached_property
    def watchdogs(self) -> pd.DataFrame:
        """When the watchdog of which slave reset it: ``time_s``, ``slave``."""
        trips = [(time, slave.label) for slave in self.slaves for time in slave.trips]
        return pd.DataFrame(sorted(trips), columns=["time_s", "slave"])

    def failure_classes(self) -> pd.DataFrame:
        """Count the failures in a row, as Siemens' analyser 3RK1904-3AB01 does.

        Indexed by slave; column n counts how often n data exchanges failed in a row, from 1 to
        the number after which the master drops the slave, or more: 6 by default.
        """
        leading = self.masters[0]
        worst = (1 + leading.repetitions) * leading.drop_after
        found = self._exchanges[["slave", "failed"]]
        # A run of failures ends with a success, with another slave, or with the record.
        run = (found != found.shift()).any(axis=1).cumsum()
        runs = found[found["failed"]].groupby(run)["slave"].agg(["first", "size"])
        table = pd.crosstab(runs["first"], runs["size"].clip(upper=worst))
        everybody = found["slave"].unique()
        whole = table.reindex(index=everybody, columns=range(1, worst + 1), fill_value=0)
        return whole.rename_axis(index="slave", columns="class")

    def response_times(self) -> pd.DataFrame:
        """Return how old inputs are when they reach the master, one row per slave.

        ``least_s``, ``mean_s`` and ``longest_s`` are the time from a change of an input to the
        end of the response that reports it, for a change at a random time between the first
        cyclic exchange that succeeds and the last. A slave that was dropped meanwhile has a long
        time. ``update_s`` is the longest time between two responses. A slave for values converts
        all the time from 0 on, as `Cycle.response_time` says, and one of its channels counts.
        """
        good = self._exchanges.query("cyclic and not failed")[["slave", "sampled", "known"]]
        parts = dict(list(good.groupby("slave", sort=False)))
        for slave in self.slaves:
            if slave.label in parts and transfers_values(slave.profile):
                parts[slave.label] = _values(parts[slave.label], slave.settings)
        good = pd.concat(parts.values()) if parts else good
        before = good.groupby("slave", sort=False)[["sampled", "known"]].shift()
        waits = pd.DataFrame(
            {
                "slave": good["slave"],
                "least_s": good["known"] - good["sampled"],
                # A value that is transferred once more says nothing new.
                "longest_s": (good["known"] - before["sampled"]).where(
                    good["sampled"] > before["sampled"], 0.0
                ),
                "update_s": good["known"] - before["known"],
                "waited": good["sampled"] - before["sampled"],
            }
        ).dropna()
        waits["area"] = waits["waited"] * (waits["least_s"] + waits["waited"] / 2)
        by = waits.groupby("slave", sort=False)
        return pd.DataFrame(
            {
                "least_s": by["least_s"].min(),
                "mean_s": by["area"].sum() / by["waited"].sum(),
                "longest_s": by["longest_s"].max(),
                "update_s": by["update_s"].max(),
            }
        )

    def utilisation(self, update: float) -> Utilisation:
        """Return how far the line was used, where each point needs an `update` [s].

        It is that of the cycles, and as long as the longest gap in them: start-up is left out.
        """
        check_scalar("update", update, "s", 1e-6, 1e6)
        record, times = self.record, self.response_times()
        if times.empty:
            raise ArgumentError("no slave was heard twice; simulate more cycles")
        first = int(np.argmax(record.cycle >= 0))
        answered = np.isfinite(record.pauses[first:]).sum()
        bits = REQUEST_BITS * (len(record.starts) - first) + RESPONSE_BITS * answered
        addresses = len({label.rstrip("AB") for label in times.index})
        return Utilisation(
            float(bits / (self.end - record.starts[first])),
            max(addresses / ADDRESSES, float(times["update_s"].max()) / update),
            float(times["longest_s"].max()),
        )

    def input_changes(self) -> pd.DataFrame:
        """Return when the master learnt of each change of inputs: one row per change.

        ``response_time_s`` is NaN where the simulation ended before, or the input had changed
        again.
        """
        good = self._exchanges.query("not failed")
        answers = []
        for change in self.changes:
            later = [
                c.time for c in self.changes if c.slave == change.slave and c.time > change.time
            ]
            own = good[good["slave"] == change.slave]
            seen = own[own["sampled"].between(change.time, min(later, default=np.inf), "left")]
            answers.append(seen["known"].iloc[0] - change.time if len(seen) else np.nan)
        frame = pd.DataFrame(self.changes, columns=["time_s", "slave", "value"])
        return frame.assign(response_time_s=np.array(answers, dtype=float))


def _values(own: pd.DataFrame, slave: Slave) -> pd.DataFrame:
    """Return when the values of one channel were converted and known, by the slave's exchanges."""
    try:
        needed = exchanges(slave.kind)
    except ArgumentError:  # nobody knows
        return own[:0]
    ends = own["known"].to_numpy()[needed - 1 :: needed]
    taken, known = ends[: -1 : slave.channels], ends[1 :: slave.channels]
    round_of_all = slave.channels * slave.conversion
    sampled = np.floor(taken / round_of_all) * round_of_all if round_of_all else taken
    return pd.DataFrame({"slave": own["slave"].iloc[0], "sampled": sampled, "known": known})


# The simulation --------------------------------------------------------------------------------

_NEVER = float("inf")

_USUAL = Transaction()

#: Without an end, a simulation in which no cycle begins for so long is given up [s].
_PATIENCE = 10.0


@checked
def simulate(
    system: Plan | Sequence[Slave],
    master: Master | None = None,
    *,
    until: float | None = None,
    cycles: int | None = None,
    faults: Fault | Iterable[Fault] = (),
    inputs: Iterable[tuple[float, str, int]] = (),
    outputs: Iterable[tuple[float, str, int]] = (),
    commands: Iterable[tuple[float, Command]] = (),
    transaction: Transaction = _USUAL,
    standby: Standby | None = None,
    rng: np.random.Generator | int | None = None,
) -> Run:
    """Simulate a line from switching it on, telegram by telegram.

    Parameters
    ----------
    system : Plan or sequence of Slave
        The slaves, up to 1000; several may have the same address. A plan of one line gives their
        distances and the delays of repeaters, too.
    master : Master, optional
        The master; by default that of the plan, or one in configuration mode.
    until : float, optional
        Stop at this time [s].
    cycles : int, optional
        Stop after so many cycles, 0..1e9; the first of the two if both are given. One is needed.
    faults : Fault or iterable of Fault, optional
        What goes wrong, from `shipnet.asi.faults`.
    inputs : iterable of (float, str, int), optional
        Time [s], slave and value 0..15: its input ports change.
    outputs : iterable of (float, str, int), optional
        Time [s], slave and value: the host sets its outputs.
    commands : iterable of (float, command), optional
        Time [s] and what the host asks of the master, from `shipnet.asi.commands`.
    transaction : Transaction, default Transaction()
        The pauses and the time-out; the pause of slaves is 1 bit time to 500 us.
    standby : Standby, optional
        A second master that takes over.
    rng : numpy.random.Generator or int, optional
        Draws the disturbances; as `numpy.random.default_rng` takes it.

    Returns
    -------
    Run
        The transactions and what follows from them.

    Raises
    ------
    ArgumentError
        If an argument is out of its range, or names a slave that is not there; or if without an
        end no cycle begins for 10 s, because no slave answers.

    Notes
    -----
    Slaves are named by the label that they have at the start. Whatever is due while a request is
    on the line happens before the slave acts on it, at the end of the request. The signal itself
    takes no time, 0.5 us in 100 m; only repeaters do.

    Examples
    --------
    One slave among 31 loses every tenth response:

    >>> from shipnet.asi import faults
    >>> slaves = [Slave(f"{address}", inputs=1) for address in range(1, 32)]
    >>> spoil = faults.TelegramErrors("7", response=0.1)
    >>> run = simulate(slaves, cycles=100, faults=spoil, rng=2024)
    >>> print(run.summary)
    100 cycles of 5.15 ms (5.14 to 5.29 ms), 3310 requests in them
    10 repetitions, 0 slaves dropped, 11 replies to executed requests lost
    >>> run.events().query("phase == 'data_exchange' and outcome != 'ok'")["slave"].eq("7").all()
    np.True_
    """
    if cycles is None and until is None:
        raise ArgumentError("cycles and until are both None; one of them is needed")
    most = None if cycles is None else check_whole("cycles", cycles, 0, 10**9)
    end = _NEVER if until is None else _time("until", until)
    transaction.check_line()
    if isinstance(system, Plan):
        master = _master_of(system) if master is None else master
        stations = Stations(_places_of(system), transaction)
    else:
        stations = Stations([(slave, 0.0, 0.0) for slave in system], transaction)
    leading = [RunningMaster(master or Master())]
    repetitions = [one.repetitions for one in (leading[0], standby and standby.master) if one]
    channel = Channel(stations.all, transaction, 1 + max(repetitions), check_rng(rng))

    for fault in as_faults(faults, LineFault):
        fault.apply(channel, stations)
    changes = [
        InputChange(_time("time", time), slave, check_whole(f"input of slave {slave}", bits, 0, 15))
        for time, slave, bits in inputs
    ]
    for change in changes:
        for station in stations[change.slave]:
            action = partial(setattr, station.slave, "inputs", change.value)
            channel.schedule(change.time, action)
    for time, slave, value in outputs:
        check_bits("output", slave, value)
        channel.schedule(_time("time", time), partial(_set_output, leading, slave, value))
    for time, command in commands:
        channel.schedule(_time("time", time), partial(_submit, leading, command))

    if until is None:
        channel.schedule(_PATIENCE, partial(_check_progress, channel, 0))
    _lead(channel, leading, standby, most, end / transaction.bit_time)
    for station in stations.all:
        station.slave.rest(channel.seconds)
    slaves = [station.slave for station in stations.all]
    return Run(channel.record, channel.time, leading, slaves, changes)


def _check_progress(channel: Channel, begun: int) -> None:
    """Raise if no cycle has begun since the last check: a master without slaves never stops."""
    if channel.begun == begun:
        raise ArgumentError(
            f"until is None, but no slave answers and no cycle begins for {_PATIENCE:g} s"
        )
    again = partial(_check_progress, channel, channel.begun)
    channel.schedule(channel.seconds + _PATIENCE, again)


def _master_of(plan: Plan) -> Master | None:
    line = plan.only_line("simulation")
    masters = [master for segment in line for master in segment.masters]
    return masters[0] if masters else None


def _places_of(plan: Plan) -> list[tuple[Slave, float, float]]:
    """Return each slave with its distance from the master [m] and the delay to it [s]."""
    placed = {}
    for segment in plan.only_line("simulation"):
        delay = sum(repeater.delay for repeater in segment.path)
        for slave in segment.slaves:
            away = segment.lead + segment.distances.get(slave.node, 0.0)
            placed[id(slave)] = slave, away, delay
    return [placed[id(slave)] for slave in plan.slaves]


def _set_output(leading: list[RunningMaster], slave: str, value: int) -> None:
    leading[-1].lists.set_output(slave, value)


def _submit(leading: list[RunningMaster], command: Command) -> None:
    leading[-1].submit(command)


def _lead(
    channel: Channel,
    leading: list[RunningMaster],
    standby: Standby | None,
    cycles: int | None,
    end: float,
) -> None:
    """Let the master, or whoever follows it, send requests until the end [bit]."""
    most = _NEVER if cycles is None else cycles
    master = leading[-1]
    program = master.run(channel)
    transact = channel.transact
    request = next(program)
    send = program.send
    while channel.begun <= most and channel.time < end:
        try:
            while channel.begun <= most and channel.time < end:
                request = send(transact(request, master.attempt))
        except MasterStops as stop:
            if stop.until < _NEVER:
                if not master.settings.monitors_supply:
                    continue
                wait = min(stop.until / channel.transaction.bit_time, end)
                channel.time = max(channel.time, wait)
                program = master.run(channel)
            elif standby is not None and not channel.standby:
                active = standby._listen(channel.record)
                silence = standby.silence / channel.transaction.bit_time
                channel.time = min(channel.time + silence, end)
                channel.standby = True
                master = RunningMaster(standby.master)
                leading.append(master)
                program = master.run(channel, active)
            else:
                if end < _NEVER:
                    channel.time = end
                return
            request = next(program)
            send = program.send


def _time(name: str, value: float) -> float:
    if not 0 <= value < _NEVER:
        raise ArgumentError(f"{name} is {value} s; it must be 0 or more, and finite")
    return value
