"""Simulate a master, its slaves and a line, telegram by telegram, and evaluate the traffic."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from math import inf
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet import style
from shipnet.answers import Utilisation
from shipnet.arrays import Floats
from shipnet.asi.channel import Channel, MasterStops, Rows, Station, Stations
from shipnet.asi.faults import LineFault
from shipnet.asi.master import Command, Master, Phase, RunningMaster
from shipnet.asi.plan import Plan
from shipnet.asi.slave import KINDS, Slave
from shipnet.asi.telegram import REQUEST_BITS, RESPONSE_BITS, Call
from shipnet.asi.timing import ADDRESSES, Transaction, exchanges, transfers_values
from shipnet.clock import Fault, as_faults
from shipnet.errors import ArgumentError, SilenceError, name_of
from shipnet.fields import check_fields, check_rng, check_scalar, check_whole, number, part, record
from shipnet.html import as_html
from shipnet.lazy import Axes, pd


@record
class Standby:
    """A second master that listens, and takes over when the first one falls silent.

    Its projected slaves must be given, because the four outputs of a standard slave look like the
    three outputs and the select bit of an A/B slave. `silence` must exceed both a working master's
    time-out and its longest pause, 500 us. The default is assumed: no source states a value.

    References
    ----------
    .. [1] "AS-Interface communication system for field networks (2)", ICN, July 2007,
       data link layer, section 1.

    Examples
    --------
    >>> Standby(Master({"5": "S-0.F"})).silence
    0.001
    """

    master: Master = part(Master, "Settings of the standby master when it takes over")
    silence: float = number(501e-6, 1e9, "s", "Silence before the takeover", default=1e-3)

    def __post_init__(self) -> None:
        check_fields(self)
        if not self.master.projected:
            raise ArgumentError("master has no projected slaves; a standby master needs them")

    def _listen(self, record: Rows, cycle: int) -> dict[str, int]:
        """Return the outputs of each projected slave that answered since two cycles before."""
        recent = np.maximum.accumulate(record["cycle"]) >= max(cycle - 2, 0)
        rows = record[recent & (record["outcome"] == 0)]
        good = rows[rows["call"] == Call.DATA_EXCHANGE]
        outputs = dict(zip(_labels(good), good["data"].tolist(), strict=True))
        return {
            label: bits for label, bits in outputs.items() if label in (self.master.projected or {})
        }


_OUTCOMES = [name_of(code) for code in range(SilenceError.code + 1)]

_LABELS = np.array([[f"{address}{half or ''}" for address in range(32)] for half in KINDS])


def _labels(rows: Rows) -> npt.NDArray[np.str_]:
    """Return the label of the slave that each request is for."""
    labels: npt.NDArray[np.str_] = _LABELS[rows["half"], rows["address"]]
    return labels


class InputChange(NamedTuple):
    """A change of a slave's input ports to `value` at `time` [s]."""

    time: float
    slave: str
    value: int


@dataclass(frozen=True)
class Summary:
    """The main results of a simulation."""

    cycles: int
    cycle_time: tuple[float, float, float]
    requests: int
    repetitions: int
    dropped: int
    lost_replies: int

    def __str__(self) -> str:
        least, mean, most = (1e3 * time for time in self.cycle_time)
        return (
            f"{self.cycles} cycles of {mean:.2f} ms ({least:.2f} to {most:.2f} ms) "
            f"with {self.requests} requests\n"
            f"{self.repetitions} repetitions, {self.dropped} slaves dropped, "
            f"{self.lost_replies} responses to executed requests lost"
        )


#: Maximum number of requests in a figure, and the number drawn of more.
_MOST_REQUESTS, _PART = 500, 40


@dataclass(frozen=True, repr=False)
class Run:
    """A finished simulation: all telegrams and their evaluation.

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

    #: All transactions, one row each; times in bits.
    record: Rows
    #: Time at which the simulation ended [bit].
    end: float
    transaction: Transaction
    #: The master, followed by the standby master if it took over.
    masters: list[RunningMaster]
    #: The slaves in their final states.
    slaves: list[Station]
    #: The changes of the inputs.
    changes: list[InputChange]

    def __repr__(self) -> str:
        summary = self.summary
        return (
            f"<Run: {summary.cycles} cycles of {1e3 * summary.cycle_time[1]:.2f} ms, "
            f"{summary.dropped} slaves dropped>"
        )

    _repr_html_ = as_html

    @cached_property
    def _events(self) -> pd.DataFrame:
        record, pauses = self.record, self.record["pause"]

        def named(column: str, names: Sequence[str]) -> pd.Categorical[str]:
            whole = pd.Categorical.from_codes(record[column], pd.Index(names))
            return whole.remove_unused_categories()

        lost = record["executed"] & (record["outcome"] > 0)
        return pd.DataFrame(
            {
                "time_s": record["start"] * self.transaction.bit_time,
                "cycle": record["cycle"],
                "phase": named("phase", [phase.name.lower() for phase in Phase]),
                "call": named("call", [call.name for call in Call]),
                "address": record["address"],
                "half": named("half", [half or "" for half in KINDS]),
                "slave": _labels(record),
                "request": record["request"].astype("U14"),
                "request_data": record["data"],
                "response_data": record["response"],
                "master_pause_bit": pauses,
                "slave_pause_bit": np.where(np.isnan(pauses), np.nan, self.transaction.slave_pause),
                "attempt": record["attempt"],
                "outcome": named("outcome", _OUTCOMES),
                "executed": record["executed"],
                "executed_but_lost": lost,
                "standby": record["standby"],
            }
        )

    def events(self) -> pd.DataFrame:
        """Return all transactions, one row each.

        The columns are ``time_s``, ``cycle`` (-1 before the first), ``phase``, ``call``,
        ``address``, ``half``, ``slave``, ``request`` (14 bits), ``request_data``,
        ``response_data`` (-1 if none), ``master_pause_bit``, ``slave_pause_bit``, ``attempt``
        (0 is the first), ``outcome`` (ok, or an error class of `shipnet.errors` such as
        ``SilenceError``), ``executed``, ``executed_but_lost`` and ``standby``.
        """
        return self._events.copy()

    @cached_property
    def _exchanges(self) -> pd.DataFrame:
        """Data exchanges by slave and time, with times of reading and receiving the inputs [s]."""
        bit_time = self.transaction.bit_time
        rows = self.record[self.record["call"] == Call.DATA_EXCHANGE]
        rows = rows[np.lexsort((rows["address"], rows["half"]))]
        sampled = rows["start"] + REQUEST_BITS
        return pd.DataFrame(
            {
                "slave": _labels(rows),
                "failed": rows["outcome"] > 0,
                "cyclic": rows["phase"] == Phase.DATA_EXCHANGE,
                "sampled": sampled * bit_time,
                "known": (sampled + rows["pause"] + RESPONSE_BITS) * bit_time,
            }
        )

    def table(self) -> pd.DataFrame:
        """Return data exchanges, failures and response times, one row per slave."""
        by = self._exchanges.groupby("slave", sort=False)["failed"]
        counts = pd.DataFrame({"exchanges": by.size(), "failed": by.sum()})
        return counts.join(self.response_times())

    @style.applied
    def plot(
        self,
        where: str | None = None,
        start: float | None = None,
        stop: float | None = None,
        *,
        ax: Axes | None = None,
    ) -> Axes:
        """Draw requests and responses as blocks over time, with rows for the master and each slave.

        `where` is a condition on the events, such as ``"phase == 'data_exchange'"``; `start` and
        `stop` are simulated times [s]. A wrong or missing response is red; a repeated request is
        hatched. Of more than 500 requests, 40 are drawn, which the title numbers:
        those around the first fault or, without faults, around the longest wait of a slave. A dot
        is a change of a slave's inputs; its arrow ends when the master receives it.
        """
        try:
            events = self._events if where is None else self._events.query(where)
        except Exception as problem:  # pandas raises errors of many kinds
            raise ArgumentError(f"where is {where!r}: {problem}") from None
        keep = events["time_s"] >= (0.0 if start is None else start)
        if stop is not None:
            keep &= events["time_s"] < stop
        shown = events[keep]
        if shown.empty:
            raise ArgumentError("where, start and stop select no request; they must select one")
        if (total := len(shown)) > _MOST_REQUESTS:
            fault = (shown["phase"] == "data_exchange") & (shown["outcome"] != "ok")
            wait = shown.groupby("slave")["time_s"].diff()
            middle = int((fault if fault.any() else wait.fillna(0.0)).argmax())
            first = min(max(middle - _PART // 2, 0), total - _PART)
            shown = shown.iloc[first : first + _PART]
            why = "the first fault" if fault.any() else "the longest wait of a slave"
        slaves = shown.sort_values(["address", "half"], kind="stable")["slave"].unique()
        ax = style.axes(ax, figsize=style.size(len(slaves) + 1))
        if total > len(shown):
            title = f"requests {first + 1} to {first + _PART} of {total}, around {why}"
            ax.set_title(title, loc="left")
        row = {slave: number + 1 for number, slave in enumerate(slaves)}
        bit_time = self.transaction.bit_time
        bit = 1e3 * bit_time
        request, response = REQUEST_BITS * bit, RESPONSE_BITS * bit
        edge: dict[str, Any] = {"edgecolor": "0.3", "linewidth": 0.5}
        for one in shown.to_dict("records"):
            begin, hatch = 1e3 * one["time_s"], "////" if one["attempt"] else None
            style.box(
                ax, begin, -0.4, request, 0.8, facecolor=style.FIELD["address"], hatch=hatch, **edge
            )
            fine, pause = one["outcome"] == "ok", one["master_pause_bit"]
            if fine and np.isnan(pause):
                continue  # a call without a response
            # A missing response is drawn at its earliest possible start.
            colour = style.FIELD["information"] if fine else style.LIMIT["color"]
            look: dict[str, Any] = {"facecolor": colour, **edge}
            if np.isnan(pause):
                pause, look = 2.0, look | {"alpha": 0.35, "linestyle": ":"}
            x, y = begin + (REQUEST_BITS + pause) * bit, row[one["slave"]] - 0.4
            style.box(ax, x, y, response, 0.8, **look)
        changes = self.input_changes()
        shown_changes = changes["slave"].isin(row) & changes["time_s"].between(
            shown["time_s"].iloc[0], shown["time_s"].iloc[-1]
        )
        for time, slave, _, wait in changes[shown_changes].itertuples(index=False):
            ax.plot(1e3 * time, row[slave], "ko", zorder=3)
            arrow: dict[str, Any] = {"arrowprops": {"arrowstyle": "->", "linewidth": 2}}
            if wait == wait:  # a change that the master does not learn of has no arrow
                ax.annotate(
                    "", (1e3 * (time + wait), row[slave]), (1e3 * time, row[slave]), **arrow
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
        cycle = np.append(self.record["cycle"], self.masters[-1].cycle)
        standby = np.append(self.record["standby"], len(self.masters) > 1)
        first = np.flatnonzero(np.diff(cycle, prepend=-2) | np.diff(standby, prepend=False))
        starts = np.append(self.record["start"], self.end)[first]
        complete = (cycle[first][:-1] >= 0) & (np.diff(cycle[first]) == 1)
        return np.asarray(np.diff(starts)[complete] * self.transaction.bit_time)

    @cached_property
    def summary(self) -> Summary:
        """The main results of the cycles, without the start-up."""
        times = self.cycle_times
        cyclic = self.record[self.record["cycle"] >= 0]
        lost = cyclic["executed"] & (cyclic["outcome"] > 0)
        some = times if times.size else np.array([np.nan])
        return Summary(
            cycles=times.size,
            cycle_time=(float(some.min()), float(some.mean()), float(some.max())),
            requests=len(cyclic),
            repetitions=int((cyclic["attempt"] > 0).sum()),
            dropped=sum(len(master.dropped) for master in self.masters),
            lost_replies=int(lost.sum()),
        )

    @cached_property
    def lists(self) -> pd.DataFrame:
        """Changes to the lists of slaves: ``time_s``, ``list``, ``slave``, ``present``."""
        rows = [change for master in self.masters for change in master.lists.changes]
        return pd.DataFrame(rows, columns=["time_s", "list", "slave", "present"])

    @cached_property
    def commands(self) -> pd.DataFrame:
        """Outcomes of the host's commands: ``time_s``, ``command``, ``done``, ``outcome``."""
        rows = [
            (time, str(command), done, outcome)
            for master in self.masters
            for time, command, done, outcome in master.finished
        ]
        return pd.DataFrame(rows, columns=["time_s", "command", "done", "outcome"])

    @cached_property
    def watchdogs(self) -> pd.DataFrame:
        """Resets of slaves by their watchdogs: ``time_s``, ``slave``."""
        trips = [(time, slave.label) for slave in self.slaves for time in slave.trips]
        return pd.DataFrame(sorted(trips), columns=["time_s", "slave"])

    def failure_classes(self) -> pd.DataFrame:
        """Count how often n data exchanges failed in a row, by slave and n.

        The last n, by default 6, is the one at which the master drops the slave; longer series
        count as this n. Siemens' analyser 3RK1904-3AB01 counts in the same way.
        """
        leading = self.masters[0]
        worst = (1 + leading.repetitions) * leading.drop_after
        tries = self._exchanges[["slave", "failed"]]
        # A series of failures ends before a success, before the next slave, or at the end.
        run = (tries != tries.shift()).any(axis=1).cumsum()
        runs = tries[tries["failed"]].groupby(run)["slave"].agg(["first", "size"])
        table = pd.crosstab(runs["first"], runs["size"].clip(upper=worst))
        everybody = tries["slave"].unique()
        whole = table.reindex(index=everybody, columns=range(1, worst + 1), fill_value=0)
        return whole.rename_axis(index="slave", columns="class")

    def response_times(self) -> pd.DataFrame:
        """Return the age of inputs when they reach the master, one row per slave.

        ``least_s``, ``mean_s`` and ``longest_s`` are the times from a change of an input to the end
        of the response that reports it. Changes are assumed to occur at random times from the first
        to the last successful cyclic exchange, even while the slave was dropped. ``update_s`` is
        the longest time between two responses. For a slave that transfers values, the times are
        those of one channel, computed as in `Cycle.response_time`.
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
                # A repeated sample conveys no change; 0 leaves it out of the maximum.
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
        """Return the utilisation after start-up if each point needs an update every `update` [s].

        The time in use is the longest time between two updates of a point divided by `update`.
        """
        check_scalar("update", update, "s", 1e-6, 1e6)
        times = self.response_times()
        if times.empty:
            raise ArgumentError("no slave answered twice; simulate more cycles")
        rows = self.record[np.argmax(self.record["cycle"] >= 0) :]
        bits = REQUEST_BITS * len(rows) + RESPONSE_BITS * np.isfinite(rows["pause"]).sum()
        addresses = len({label.rstrip("AB") for label in times.index})
        in_use = max(addresses / ADDRESSES, float(times["update_s"].max()) / update)
        busy = float(bits / (self.end - rows["start"][0]))
        return Utilisation(busy, in_use, float(times["longest_s"].max()))

    def input_changes(self) -> pd.DataFrame:
        """Return the response time to each change of inputs, with one row per change.

        ``response_time_s`` is NaN if the simulation ended, or the input changed again, before the
        master received the change.
        """
        good = self._exchanges.query("not failed")
        answers = []
        for change in self.changes:
            times = [c.time for c in self.changes if c.slave == change.slave]
            until = min((time for time in times if time > change.time), default=np.inf)
            during = good["sampled"].between(change.time, until, "left")
            seen = good.loc[during & (good["slave"] == change.slave), "known"]
            answers.append(seen.iloc[0] - change.time if len(seen) else np.nan)
        frame = pd.DataFrame(self.changes, columns=["time_s", "slave", "value"])
        return frame.assign(response_time_s=np.array(answers, dtype=float))


def _values(exchanges_of_slave: pd.DataFrame, slave: Slave) -> pd.DataFrame:
    """Return the times at which one channel's values were converted and reached the master."""
    try:
        needed = exchanges(slave.kind)
    except ArgumentError:  # its number of exchanges is not published
        return exchanges_of_slave[:0]
    ends = exchanges_of_slave["known"].to_numpy()[needed - 1 :: needed]
    taken, arrived = ends[: -1 : slave.channels], ends[1 :: slave.channels]
    round_of_all = slave.channels * slave.conversion
    sampled = np.floor(taken / round_of_all) * round_of_all if round_of_all else taken
    return pd.DataFrame(
        {"slave": exchanges_of_slave["slave"].iloc[0], "sampled": sampled, "known": arrived}
    )


_USUAL = Transaction()

#: A simulation without `until` raises an error if no cycle begins for this time [s].
_PATIENCE = 10.0


def simulate(
    system: Plan | Sequence[Slave],
    master: Master | None = None,
    *,
    until: float | None = None,
    cycles: int | None = None,
    faults: Fault | Iterable[Fault] = (),
    inputs: Iterable[tuple[float, str, int]] = (),
    commands: Iterable[tuple[float, Command]] = (),
    transaction: Transaction = _USUAL,
    standby: Standby | None = None,
    rng: np.random.Generator | int | None = None,
) -> Run:
    """Simulate a line from power-on, telegram by telegram.

    Parameters
    ----------
    system : Plan or sequence of Slave
        The slaves, up to 1000, which may share addresses; or a plan of one line, which also gives
        their distances and the delays of repeaters.
    master : Master, optional
        The master; by default that of the plan, or one in configuration mode.
    until : float, optional
        Stop at this time, 0..1e9 [s].
    cycles : int, optional
        Stop after this number of cycles, 0..1e9. At least one of `until` and `cycles` is needed.
    faults : Fault or iterable of Fault, optional
        Faults from `shipnet.asi.faults`.
    inputs : iterable of (float, str, int), optional
        Changes of input ports: time [s], slave and value 0..15.
    commands : iterable of (float, command), optional
        Commands of the host from `shipnet.asi.commands`, each with its time [s].
    transaction : Transaction, default Transaction()
        The pauses and the time-out; the slave pause must be 1 bit time to 500 us.
    standby : Standby, optional
        A second master that takes over.
    rng : numpy.random.Generator or int, optional
        Source of random numbers for the disturbances.

    Returns
    -------
    Run
        The transactions and their evaluation.

    Raises
    ------
    ArgumentError
        If an argument is out of range or names a slave that is not on the line, or if, without
        `until`, no slave answers and no cycle begins for 10 s.

    Notes
    -----
    Slaves are named by their initial labels. An event during a request takes effect before a slave
    acts on the request. Repeaters delay the signal; the cable delay, 0.65 us in 100 m, is ignored.

    Examples
    --------
    One of 31 slaves loses one response in ten:

    >>> from shipnet.asi import faults
    >>> slaves = [Slave(f"{address}", inputs=1) for address in range(1, 32)]
    >>> spoil = faults.TelegramErrors("7", response=0.1)
    >>> run = simulate(slaves, cycles=100, faults=spoil, rng=2024)
    >>> print(run.summary)
    100 cycles of 5.15 ms (5.14 to 5.29 ms) with 3310 requests
    10 repetitions, 0 slaves dropped, 11 responses to executed requests lost
    """
    if cycles is None and until is None:
        raise ArgumentError("cycles and until are both None; one of them is needed")
    most = inf if cycles is None else check_whole("cycles", cycles, 0, 10**9)
    end = inf if until is None else check_scalar("until", until, "s", 0, 1e9)
    transaction.check_line()
    if isinstance(system, Plan):
        system.only_line("simulation")
        master = master or next(iter(system.masters), None)
        # Each slave, its distance from the master [m] and the delay of its repeaters [s].
        places = [
            (slave, segment.lead + segment.distances.get(slave.node, 0.0), segment.delay)
            for slave, segment in system.located
        ]
        stations = Stations(places, transaction)
    else:
        stations = Stations([(slave, 0.0, 0.0) for slave in system], transaction)
    leading = [RunningMaster(master or Master())]
    repetitions = [one.repetitions for one in (leading[0], standby and standby.master) if one]
    channel = Channel(
        stations,
        transaction,
        1 + max(repetitions),
        check_rng(rng),
        cycles=most,
        until=end / transaction.bit_time,
    )

    for fault in as_faults(faults, LineFault):
        fault.apply(channel, stations)
    changes = []
    for time, slave, bits in inputs:
        value = check_whole(f"input of slave {slave}", bits, 0, 15)
        changes.append(InputChange(check_scalar("time", time, "s", 0, 1e9), slave, value))
        for station in stations[slave]:
            channel.schedule(changes[-1].time, partial(station.fields.__setitem__, "inputs", value))
    for time, command in commands:
        begin = check_scalar("time", time, "s", 0, 1e9)
        channel.schedule(begin, partial(_submit, leading, command))

    if until is None:
        channel.schedule(_PATIENCE, partial(_check_progress, channel, 0))
    _lead(channel, leading, standby)
    for station in stations.all:
        station.rest(channel.seconds)
    return Run(channel.record, channel.time, transaction, leading, stations.all, changes)


def _submit(leading: list[RunningMaster], command: Command) -> None:
    leading[-1].submit(command)


def _check_progress(channel: Channel, begun: int) -> None:
    """Raise ArgumentError if no cycle has begun since the last check, or schedule the next one."""
    if channel.begun == begun:
        raise ArgumentError(
            f"until is None, but no slave answers and no cycle begins for {_PATIENCE:g} s"
        )
    again = partial(_check_progress, channel, channel.begun)
    channel.schedule(channel.seconds + _PATIENCE, again)


def _lead(channel: Channel, leading: list[RunningMaster], standby: Standby | None) -> None:
    """Let the master and then any standby master run until the simulation is over."""
    master = leading[-1]
    program, reply = master.run(channel, poll=channel.poll), None
    while True:
        try:
            request = next(program) if reply is None else program.send(reply)
            if channel.over:
                return
            reply = channel.transact(request, master.attempt)
        except StopIteration:
            return
        except MasterStops as stop:
            reply = None
            if stop.until < inf:
                wait = min(stop.until / channel.transaction.bit_time, channel.until)
                channel.time = max(channel.time, wait)
                program = master.run(channel, poll=channel.poll)
            elif standby is not None and not channel.standby:
                active = standby._listen(channel.record, master.cycle)
                silence = standby.silence / channel.transaction.bit_time
                channel.time = min(channel.time + silence, channel.until)
                channel.standby = True
                master = RunningMaster(standby.master)
                leading.append(master)
                program = master.run(channel, active, channel.poll)
            else:
                channel.time = channel.until if channel.until < inf else channel.time
                return
