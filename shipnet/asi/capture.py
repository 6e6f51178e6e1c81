"""Decode recorded line voltages into telegrams and transactions, and judge the line by them."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field
from functools import cache, cached_property
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from shipnet import style
from shipnet.answers import Findings
from shipnet.arguments import checked
from shipnet.arrays import Bools, Floats, Indices, parts_of
from shipnet.asi.batch import NONE, Requests, parse_responses
from shipnet.asi.bursts import Telegrams, find_telegrams
from shipnet.asi.causes import Found, Restored, line_causes, ranked, restored, sender_causes
from shipnet.asi.receiver import TOLERANCE
from shipnet.asi.rules import rule_limits
from shipnet.asi.telegram import REQUEST_BITS, RESPONSE_BITS, Call, Request, Response
from shipnet.asi.timing import BIT_TIME, MASTER_PAUSE_BITS
from shipnet.errors import ArgumentError, SilenceError, name_of
from shipnet.lazy import Axes, pd
from shipnet.line.waveform import Waveform

if TYPE_CHECKING:
    from shipnet.asi.plan import Plan

#: Values of the error columns besides "ok" and the names of error classes.
CUT_OFF, NO_ANSWER = "cut off", "no answer"

#: Longest pause after a request in which its response begins [bit], with room for its pulses'
#: delay, and the longest one after a response: a master may stretch it to 500 us.
_MASTER_PAUSE = MASTER_PAUSE_BITS[1] + 0.5
_SLAVE_PAUSE = 500e-6 / BIT_TIME

#: Values of the error columns by number: the error codes of telegrams, then the other values.
_STATES = [*map(name_of, range(SilenceError.code + 1)), CUT_OFF, NO_ANSWER, ""]


def transactions_of(
    telegrams: Telegrams, ends: Floats, extended: Collection[int] = ()
) -> pd.DataFrame:
    """Pair requests with responses, and return one row per transaction with its meaning."""
    cut, asks, answers = _roles(telegrams)
    request, response = _pairs(asks, answers)
    states = np.where(cut, _STATES.index(CUT_OFF), telegrams.error)
    nothing = _STATES.index("")
    request_error, response_error = (
        _pick(states, request, nothing),
        _pick(states, response, nothing),
    )

    readable = request_error == 0
    words = np.where(readable, _pick(telegrams.word, request, 0), -1)
    calls = Requests.parse(words, extended=np.isin(words >> 7 & 31, list(extended)))
    request_error[readable] = calls.error[readable]
    replies = np.where(response_error == 0, _pick(telegrams.word, response, 0), -1)
    data, _ = parse_responses(replies)

    # A request at the end of the record has no answer yet.
    start = _pick(telegrams.start, request, np.nan)
    rest = np.append(ends, np.inf)[np.searchsorted(ends, start)] - start
    room = (REQUEST_BITS + MASTER_PAUSE_BITS[1] + RESPONSE_BITS) * BIT_TIME
    asks = np.array([call.rule.answer is not None for call in Call] + [False])[calls.call]
    alone = (response < 0) & (request_error == 0) & asks
    response_error[alone] = np.where(
        rest[alone] < room, _STATES.index(CUT_OFF), _STATES.index(NO_ANSWER)
    )

    # There are few different texts, so a column picks from them by number.
    titles, errors = pd.Index([*(call.rule.title for call in Call), ""]), pd.Index(_STATES)
    texts, which = _texts(telegrams)
    asked, answered = (_pick(which, rows, len(texts) - 1) for rows in (request, response))
    # Column by column, so that only one column of a long record is in memory twice.
    table = pd.DataFrame(
        {"start_s": np.where(request >= 0, start, _pick(telegrams.start, response, np.nan))}
    )
    table["request"] = texts[asked]
    table["call"] = titles[calls.call]
    table["address"] = _nullable(calls.address)
    table["half"] = pd.Index(["A", "B", ""])[calls.half]
    table["request_data"] = _nullable(calls.data)
    table["response"] = texts[answered]
    table["response_data"] = _nullable(data)
    table["master_pause_bit"], table["slave_pause_bit"] = _pauses(telegrams, request, response, cut)
    for name in ("amplitude", "weakest", "ringing"):
        for kind, rows in (("request", request), ("response", response)):
            column = f"{kind}_{name}" + "_V" * (name == "amplitude")
            table[column] = _pick(telegrams[name], rows, np.nan)
    table["request_error"], table["response_error"] = errors[request_error], errors[response_error]
    # The bits of a request determine its call.
    sizes = len(texts), len(errors), len(texts), len(errors)
    key = np.ravel_multi_index((asked, request_error, answered, response_error), sizes)
    _, first, which = np.unique(key, return_index=True, return_inverse=True)
    some = table.iloc[first]
    sentences = map(
        _in_words, some["request"], some["request_error"], (calls.half[first] >= 0).tolist(),
        some["response"], some["response_error"], calls.call[first].tolist(),
    )  # fmt: skip
    table["text"] = pd.Categorical(list(sentences))[which]
    return table


def _pick(field: npt.NDArray[Any], index: Indices, missing: float) -> npt.NDArray[Any]:
    """Return elements of a field, and `missing` where the index is -1."""
    return np.where(index < 0, missing, field[index])


def _roles(telegrams: Telegrams) -> tuple[Bools, Bools, Bools]:
    """Return which telegrams are cut off, which are requests, and which answer one."""
    # The time from the last pulse to the next first one is a bit time more than the pause.
    pause = np.diff(telegrams.first, prepend=np.nan)
    pause[1:] = (telegrams.first[1:] - telegrams.last[:-1]) / BIT_TIME - 1
    broken = (telegrams.error > 0) | ~telegrams.fits
    short = telegrams.length == RESPONSE_BITS
    # The last half of a request, and the first one, may look like a response.
    front = (telegrams.edge == 1) & (broken | short)
    asks = ~short | front
    in_time = np.append(False, asks[:-1]) & (pause <= _MASTER_PAUSE)
    back = (telegrams.edge == 2) & ~front & (broken | (short & ~in_time))
    asks = np.where(back, ~in_time, asks)
    return front | back, asks, ~asks & np.append(False, asks[:-1]) & (pause <= _MASTER_PAUSE)


def _pairs(asks: Bools, answers: Bools) -> tuple[Indices, Indices]:
    """Return, for each transaction, which telegram is its request and its response, or -1."""
    row = np.cumsum(~answers) - 1
    rows = int((~answers).sum())
    request, response = np.full(rows, -1), np.full(rows, -1)
    request[row[asks]] = np.flatnonzero(asks)
    response[row[~asks]] = np.flatnonzero(~asks)
    return request, response


def _pauses(
    telegrams: Telegrams, request: Indices, response: Indices, cut: Bools
) -> tuple[Floats, Floats]:
    """Return the pauses after requests and after responses [bit], NaN where there is none."""
    # A telegram that is cut off at its front has lost its start.
    begins = np.where(cut & (telegrams.edge == 1), np.nan, telegrams.start)
    asked, answered = _pick(begins, request, np.nan), _pick(begins, response, np.nan)
    master = (answered - asked) / BIT_TIME - REQUEST_BITS
    slave = np.full(len(request), np.nan)
    slave[:-1] = (asked[1:] - answered[:-1]) / BIT_TIME - RESPONSE_BITS
    slave[~(slave <= _SLAVE_PAUSE)] = np.nan
    return master, slave


def _texts(telegrams: Telegrams) -> tuple[pd.Index[str], Indices]:
    """Return the different texts, "" as the last one, and the number of each telegram's text.

    A text has 0 and 1, and ? where no pulse gave a bit.
    """
    mask = (1 << REQUEST_BITS) - 1
    key = telegrams.length.astype(np.int64) << REQUEST_BITS | telegrams.known
    which, different = pd.factorize(key << REQUEST_BITS | telegrams.word)
    texts = []
    for code in different.tolist():
        length = code >> 2 * REQUEST_BITS
        bits, heard = f"{code & mask:0{length}b}", f"{code >> REQUEST_BITS & mask:0{length}b}"
        pairs = zip(bits, heard, strict=True)
        texts.append("".join(bit if one == "1" else "?" for bit, one in pairs))
    return pd.Index([*texts, ""]), which


def _nullable(values: npt.NDArray[np.int8]) -> pd.api.extensions.ExtensionArray:
    return pd.arrays.IntegerArray(values.astype(np.int64), values == NONE)


def _in_words(
    request: str, request_error: str, extended: bool, response: str, response_error: str, call: int
) -> str:
    """Return one line about request and answer, or about what went wrong."""
    parts = []
    if request_error == "ok":
        parts.append(str(Request.parse(request, extended=extended)))
    elif request_error:
        parts.append(f"request {request_error}: {request}")
    if response_error == "ok":
        try:
            parts.append(str(Response.parse(response, None if call == NONE else Call(call))))
        except ArgumentError:
            parts.append(f"response {response} where none is expected")
    elif response_error == NO_ANSWER:
        parts.append(NO_ANSWER)
    elif response_error:
        parts.append(f"response {response_error}" + (f": {response}" if response else ""))
    return "; ".join(parts)


#: Lowest supply voltage that is not a power fail [V] (Bihl+Wiedemann's tuner), and the voltage
#: below which the record is AC coupled.
POWER_FAIL, _COUPLED = 18.5, 5.0


@cache
def _limits() -> tuple[float, float, float, float]:
    """Return the limits of a first pulse, half of those peak to peak, and of the supply [V]."""
    limits = rule_limits()
    low, high = limits["low"], limits["high"]
    level = low["signal_level_least"] / 2, high["signal_level_most"] / 2
    return *level, low["slave_voltage"], high["supply_voltage"]


#: A master repeats a request within this time [s]; a later one belongs to the next cycle.
_AT_ONCE = 1e-3

#: A request and a restored one are the same if they begin within this time of each other [s].
_SAME = 4e-6

#: Calls by which a master looks for new slaves; they need no answer.
_IDENTIFICATION = [
    call.rule.title
    for call in (Call.READ_IO_CONFIGURATION, Call.READ_ID, Call.READ_ID1, Call.READ_ID2)
]

#: Share of repetitions up to which a line is green, and yellow (P+F, AS-i 3.0 command interface).
_LIGHTS = 0.01, 0.05

#: Name of the slave if a telegram's address cannot be read.
UNKNOWN = "unknown"

_FINE = ["ok", "", CUT_OFF]


@dataclass(frozen=True)
class Summary:
    """Main results of a capture."""

    transactions: int
    cycle_time: float
    repetitions: int
    unanswered: int
    seen: list[str]
    missing: list[str]
    #: Addresses at which the master looked for new slaves and found none.
    vacant: list[str]
    errors: dict[str, int]
    cut_off: int
    slaves: pd.DataFrame

    def __str__(self) -> str:
        errors = ", ".join(f"{name} {count}" for name, count in self.errors.items())
        cycle = "unknown" if np.isnan(self.cycle_time) else f"{self.cycle_time * 1e3:.3f} ms"
        return "\n".join(
            [
                f"transactions   {self.transactions}, {self.cut_off} telegrams cut off",
                f"cycle time     {cycle}",
                f"repetitions    {self.repetitions}",
                f"unanswered     {self.unanswered}",
                f"slaves seen    {', '.join(self.seen) or 'none'}",
                f"never answered {', '.join(self.missing) or 'none'}",
                f"none at        {', '.join(self.vacant) or '-'} (the master looks for new slaves)",
                f"errors         {errors or 'none'}",
            ]
        )


def _repeated(transactions: pd.DataFrame) -> Bools:
    """Return which rows repeat a request that failed in the row before."""
    request = transactions["request"].to_numpy()
    start = transactions["start_s"].to_numpy()
    failed = (
        ~transactions["request_error"].isin(["ok", CUT_OFF])
        | ~transactions["response_error"].isin(["ok", "", CUT_OFF])
    ).to_numpy()
    repeated = np.zeros(len(request), dtype=bool)
    for row in np.flatnonzero(failed[:-1]) + 1:
        before, now = request[row - 1], request[row]
        if before and len(before) == len(now) and start[row] - start[row - 1] < _AT_ONCE:
            differences = sum(a != b for a, b in zip(before, now, strict=True) if a != "?")
            repeated[row] = differences <= 1
    return repeated


def _cycle_time(transactions: pd.DataFrame, asked: pd.DataFrame) -> float:
    """Return the median time after which a slave is asked for data again [s]."""
    data = (asked["call"] == "data exchange").to_numpy()
    times = transactions["start_s"][data].groupby(asked["slave"][data]).diff().dropna()
    return float(times.median()) if len(times) else float("nan")


def _who(capture: Capture) -> pd.DataFrame:
    """Return slave and call of each transaction; bad requests are read from the restored record."""
    rows = capture.transactions
    address = rows["address"].astype(object).fillna(NONE).to_numpy(np.int64)
    half, calls = rows["half"].tolist(), rows["call"].tolist()
    names = [UNKNOWN if a == NONE else f"{a}{h}" for a, h in zip(address, half, strict=True)]
    names = ["" if c == "broadcast reset" else n for c, n in zip(calls, names, strict=True)]
    asked = pd.DataFrame({"slave": names, "call": calls}, index=rows.index, dtype=object)
    bad = ~rows["request_error"].isin(_FINE).to_numpy()
    if not bad.any() or not len(capture._restored.start):
        return asked
    there, words = capture._restored.start, capture._restored.words
    read = Requests.parse(words, extended=np.isin(words >> 7 & 31, capture.extended))
    start = rows["start_s"].to_numpy()
    near = np.minimum(np.searchsorted(there, start - _SAME), len(there) - 1)
    near[~(np.abs(start - there[near]) < _SAME) | (read.error[near] > 0) | ~bad] = -1
    # A request with the same bits elsewhere means the same.
    texts = rows["request"].tolist()
    meant = {texts[row]: int(near[row]) for row in np.flatnonzero(near >= 0)}
    for row in np.flatnonzero(bad & rows["request"].isin(meant).to_numpy()):
        k = meant[texts[row]]
        names[row] = f"{read.address[k]}{('A', 'B', '')[read.half[k]]}"
        calls[row] = Call(int(read.call[k])).rule.title
    return asked.assign(slave=names, call=calls)


def _slaves(transactions: pd.DataFrame, asked: pd.DataFrame) -> pd.DataFrame:
    """Return one row per address that was asked, and one for telegrams without an address."""
    rows = transactions.assign(slave=asked["slave"])[asked["slave"] != ""]
    by = rows["slave"]
    response, request = rows["response_error"], rows["request_error"]
    heard = rows[(rows["response"] != "") & (response != CUT_OFF)].groupby("slave")
    bad_requests = ~request.isin(_FINE)
    polled = ~asked["call"].isin(_IDENTIFICATION)
    table = pd.DataFrame(
        {
            "requests": (rows["request"] != "").groupby(by).sum(),
            "answers": (response == "ok").groupby(by).sum(),
            "unanswered": (response == NO_ANSWER).groupby(by).sum(),
            "polled": polled.groupby(by).any(),
            "bad_requests": bad_requests.groupby(by).sum(),
            "errors": (~response.isin([*_FINE, NO_ANSWER])).groupby(by).sum(),
            "amplitude_V": heard["response_amplitude_V"].median(),
            "weakest_pulse": heard["response_weakest"].min(),
            "ringing": heard["response_ringing"].max(),
        }
    )
    order = sorted(table.index, key=lambda name: (name == UNKNOWN, len(name.rstrip("AB")), name))
    return table.loc[order].rename_axis("slave")


#: Longest time between two samples [s]: three samples a half-bit.
_LONGEST_STEP = 1e-6


@checked
@dataclass(frozen=True)
class Capture:
    """A decoded record.

    Attributes
    ----------
    transactions : pandas.DataFrame
        One row per transaction, in the order of time:

        - ``start_s``: start of the request, or of a response without one [s];
        - ``request``, ``response``: bits as sent, ``?`` without a pulse, "" without a telegram;
        - ``call``, ``address``, ``half`` ("A", "B" or ""), ``request_data``, ``response_data``:
          their meaning; empty for a bad telegram;
        - ``master_pause_bit``, ``slave_pause_bit``: pauses after request and response [bit];
        - ``request_amplitude_V`` and so on: size of the first pulse;
        - ``request_weakest``, ``request_ringing`` and so on: as in `Reception`;
        - ``request_error``, ``response_error``: "ok", a class of `shipnet.errors`, "cut off" at an
          end of the record, "no answer", or "" where no telegram is expected;
        - ``text``: the transaction in words; like the bits, a categorical column.
    duration : float
        Length of the record [s].
    inverted : bool
        Whether the probe was the wrong way round.
    minimum : float
        Voltage below which nothing counted as a pulse [V].
    disturbances : int
        Number of bursts with too few pulses for a telegram.
    wave : shipnet.line.Waveform
        The record.
    extended : tuple of int
        Addresses of A/B slaves.

    Examples
    --------
    >>> from shipnet.asi.topologies import line
    >>> wave = line(80, slaves=(80,)).waveform("0011001", "80 m", after=1e-3)
    >>> capture = decode(wave)
    >>> capture.table()["text"].tolist(), capture.telegrams
    (['response: 0110 (6)'], 1)
    """

    transactions: pd.DataFrame
    duration: float
    inverted: bool
    minimum: float
    disturbances: int
    wave: Waveform = field(repr=False, compare=False)
    extended: tuple[int, ...] = ()

    def __repr__(self) -> str:
        return (
            f"Capture({self.telegrams} telegrams in {len(self.transactions)} transactions, "
            f"{1e3 * self.duration:.3g} ms)"
        )

    @property
    def telegrams(self) -> int:
        """Number of telegrams that were received without an error."""
        columns = self.transactions[["request_error", "response_error"]]
        return int((columns == "ok").to_numpy().sum())

    def table(self) -> pd.DataFrame:
        """Return one row per transaction; see `transactions`."""
        return self.transactions.copy()

    @property
    def slaves(self) -> pd.DataFrame:
        """One row per slave that was asked: answers, errors, level, evenness and ringing.

        Requests that cannot be attributed to one slave are in the row ``"unknown"``.
        """
        return self.summary().slaves

    @cached_property
    def _middle(self) -> float:
        step = max(1, len(self.wave.u) // 100_000)
        looks = [part[::step].copy() for _, part in parts_of(self.wave.u, 1000 * step)]
        some = np.concatenate(looks)
        some = some[~np.isnan(some)]
        return float(np.median(some)) if len(some) else 0.0

    @property
    def supply_voltage(self) -> float:
        """Voltage of the supply [V]; NaN if the record is AC coupled."""
        return abs(self._middle) if abs(self._middle) > _COUPLED else float("nan")

    def check(self, plan: Plan | None = None) -> Findings:
        """Judge level, evenness, ringing and errors of requests and responses.

        The level is the size of the first pulse: half of 3 to 8 V peak to peak. The supply is
        judged if the record is DC coupled. With a `plan` every slave in it must have answered.
        """
        return Findings(_judged(self, plan))

    def causes(self) -> pd.DataFrame:
        """Return the probable causes of a faulty line, the likeliest first.

        The table is indexed by cause and empty for a good line: `slave`, if it concerns one;
        `share` of the violated findings of `check` that it explains, 0..1; and the `evidence`. The
        causes are a cable too long or a stub, a second supply, a supply inductance missing or
        wrong, interference, a duplicate address, a weak slave and a reversed probe.

        The rules look at the impedance that the requests meet: two supplies halve its resistance
        and inductance; a long cable or a stub adds capacitance and echoes. A scope at a slave
        shows it less exactly. The rules were found on simulated lines and tested on others; a real
        line may differ.

        Examples
        --------
        >>> from shipnet.asi import line
        >>> plan = line(60, slaves=(10, 30, 60))
        >>> decode(plan.record(10e-3, weak={"2": 0.4}, rng=2024)).causes()["slave"].to_dict()
        {'weak slave': '2'}
        """
        broken, slaves = self.check().violated(), self.slaves
        found: list[Found] = []
        if len(broken) or self.disturbances:
            answering = int((slaves["answers"] > 0).sum())
            found = line_causes(
                self._restored, self.transactions, answering, self.disturbances,
                self.supply_voltage,
            ) or sender_causes(slaves, self.disturbances)  # fmt: skip
        return ranked(found, broken, self.inverted)

    def counters(self) -> pd.DataFrame:
        """Return the counters of masters and analysers: `value`, `light` and `meaning`.

        The percentage of repetitions is green up to 1 %, yellow up to 5 % and red above; the
        other counters are green at 0. A value that the record cannot show is NaN and has no light.

        Examples
        --------
        >>> from shipnet.asi import line
        >>> counters = decode(line(60, slaves=3).record(10e-3, rng=2024)).counters()
        >>> counters.loc[["missing slave frames", "repetitions"], "light"].tolist()
        ['green', 'green']
        """
        return _counted(self)

    def plot(
        self, ax: Axes | None = None, *, start: float = 0.0, stop: float | None = None
    ) -> Axes:
        """Draw the record from `start` to `stop` [s] with its telegrams shaded and their bits.

        An error's name is above the bits. Two lines show the least size of a first pulse.
        """
        ax = style.axes(ax, figsize=(10, 3.2))
        u, dt = self.wave.u, self.wave.dt
        stop = len(u) * dt if stop is None else stop
        low, high = max(0, int(start / dt)), min(len(u), int(stop / dt) + 1)
        # A figure has fewer dots than samples, so the extremes of each group are drawn in order.
        group = max(1, (high - low) // 10_000)
        whole = u[low : high - (high - low) % group].reshape(-1, group)
        index = np.stack([whole.argmin(axis=1), whole.argmax(axis=1)], axis=1)
        index = np.unique(np.arange(len(whole))[:, np.newaxis] * group + index)
        ax.plot((low + index) * dt * 1e6, u[low:high][index], color="C0", linewidth=0.8)

        zero = 0.0 if np.isnan(self.supply_voltage) else self._middle
        colour, dashes = style.LIMIT["color"], style.LIMIT["linestyle"]
        least = _limits()[0]
        for sign in (1, -1):
            ax.axhline(zero + sign * least, color=colour, linestyle=dashes)
        ax.text(
            1.01, zero - least, f"{least:g} V", transform=ax.get_yaxis_transform(),
            color=colour, va="center",
        )  # fmt: skip
        ends = ax.get_xaxis_transform()
        for row in self.transactions.to_dict("records"):
            begin = row["start_s"]
            for kind in ("request", "response"):
                bits, error = row[kind], row[f"{kind}_error"]
                if kind == "response" and row["request"]:
                    begin = row["start_s"] + (REQUEST_BITS + row["master_pause_bit"]) * BIT_TIME
                middle, length = begin + len(bits) * BIT_TIME / 2, len(bits) * BIT_TIME
                if not bits or not start <= middle <= stop:
                    continue
                colour = style.FIELD["address" if kind == "request" else "information"]
                ax.axvspan(
                    begin * 1e6, (begin + length) * 1e6, color=colour, alpha=0.5, linewidth=0
                )
                there: dict[str, Any] = {"transform": ends, "ha": "center"}
                ax.text(middle * 1e6, 1.02, bits, family="monospace", **there)
                if error != "ok":
                    ax.text(middle * 1e6, 1.1, error, color=style.LIMIT["color"], **there)
        ax.set(xlim=(start * 1e6, stop * 1e6), xlabel="time [us]", ylabel="voltage [V]")
        return ax

    def __str__(self) -> str:
        lines = [str(self.summary())]
        for cause, slave, _, evidence in self.causes().itertuples():
            lines.append(f"probable cause {f'{cause} {slave}'.rstrip()}: {evidence}")
        return "\n".join(lines)

    def summary(self) -> Summary:
        """Return cycle time, repetitions, missing slaves and errors."""
        return self._summary

    @cached_property
    def _summary(self) -> Summary:
        transactions = self.transactions
        states = transactions[["request_error", "response_error"]].to_numpy()
        faults = [state for state in states.ravel() if state not in (*_FINE, NO_ANSWER)]
        repeated = _repeated(transactions)
        slaves = _slaves(transactions, self._asked)
        known = slaves[slaves.index != UNKNOWN]
        silent = known[(known["answers"] == 0) & (known["unanswered"] > 0)]
        return Summary(
            len(transactions),
            _cycle_time(transactions[~repeated], self._asked[~repeated]),
            int(repeated.sum()),
            int((transactions["response_error"] == NO_ANSWER).sum()),
            list(known.index[known["answers"] > 0]),
            list(silent.index[silent["polled"]]),
            list(silent.index[~silent["polled"]]),
            {name: faults.count(name) for name in sorted(set(faults))},
            int((states == CUT_OFF).sum()),
            slaves.drop(silent.index[~silent["polled"]]).drop(columns=["unanswered", "polled"]),
        )

    @cached_property
    def _restored(self) -> Restored:
        """The first 40 ms with the cable's distortion removed, so that bad requests can be read."""
        rows = self.transactions
        asked = rows[(rows["request"].str.len() == REQUEST_BITS) & rows["start_s"].notna()]
        good = rows[rows["request_error"] == "ok"]
        words = np.array([int(bits, 2) for bits in good["request"]], np.int64)
        starts = asked["start_s"].to_numpy(), good["start_s"].to_numpy()
        return restored(self.wave.u, self.wave.dt, *starts, words, self.inverted)

    @cached_property
    def _asked(self) -> pd.DataFrame:
        """Slave and call of each transaction, if possible also of bad requests."""
        return _who(self)


def _judged(capture: Capture, plan: Plan | None) -> pd.DataFrame:
    """Return the findings on a capture as the table that `Findings` accepts."""
    nan, table, slaves = float("nan"), capture.transactions, capture.slaves
    volts, read = capture.supply_voltage, float(capture.telegrams)
    rows = [("telegrams", "line", read, 1.0, nan, "", "telegrams read")]
    if volts == volts:
        rows.append(("supply voltage", "supply", volts, *_limits()[2:], "V", "at the scope"))
    asked = table[~table["request_error"].isin(["", CUT_OFF])]
    level, weakest = asked["request_amplitude_V"].min(), asked["request_weakest"].min()
    bad = float((asked["request_error"] != "ok").sum())
    heard = [("request", "master", level, weakest, asked["request_ringing"].max(), bad)]
    for name, *values in slaves[["amplitude_V", "weakest_pulse", "ringing", "errors"]].itertuples():
        if name != UNKNOWN:
            heard.append(("response", f"slave {name}", *values))
    for kind, who, level, weakest, ringing, bad in heard:
        # At the master's own end a request may be larger than anywhere else.
        least, most, *_ = _limits()
        most = most if kind == "response" else nan
        for what, value, low, high, unit in (
            ("level", level, least, most, "V"),
            ("evenness", weakest, TOLERANCE.evenness, nan, ""),
            ("ringing", ringing, nan, TOLERANCE.ringing, ""),
            ("errors", bad, nan, 0.0, ""),
        ):
            if value == value:
                why = f"{kind}s of {who}"
                rows.append((f"{kind} {what}", who, float(value), low, high, unit, why))
    for one in plan.slaves if plan is not None else ():
        count = float(slaves["answers"].get(one.label, 0))
        rows.append(("answers", f"slave {one.label}", count, 1.0, nan, "", "it is in the plan"))
    columns = ["rule", "object", "value", "low", "high", "unit", "why"]
    found = pd.DataFrame(rows, columns=columns)
    missed = (found["value"] < found["low"]) | (found["value"] > found["high"])
    found["verdict"] = np.where(missed, "violated", "met")
    found["source"] = "IEC 62026-2 as quoted by SAP5S/SAP51, 2012, p. 29; kim2023, section 3.4"
    found.loc[found["rule"] == "supply voltage", "source"] = "ifm AC2904; SEW 31545580"
    return found


def _counted(capture: Capture) -> pd.DataFrame:
    """Return the counters of a capture."""
    table, summary = capture.transactions, capture.summary()
    slave, call = capture._asked["slave"], capture._asked["call"]
    request, response = table["request_error"], table["response_error"]
    silent = (response == NO_ANSWER) & ~call.isin(_IDENTIFICATION)
    data = (call == "data exchange") & (slave != UNKNOWN)
    failed = (~request.isin(_FINE) | ~response.isin(_FINE))[data].groupby(slave[data])
    runs = [run for _, tries in failed for run in "".join(map("01".__getitem__, tries)).split("0")]
    # A master drops a slave after two failed tries in each of three cycles.
    dropped = sum(len(run) >= 6 for run in runs)
    unexpected = table["text"].str.endswith("where none is expected")
    asked = int((table["request"] != "").sum())
    nan = float("nan")
    share = summary.repetitions / asked if asked else nan
    rows = [
        ("power fail", _power_fails(capture), f"times that the supply falls below {POWER_FAIL} V"),
        ("earth fault", nan, "not seen between the two wires; measure each against earth"),
        ("slave failure", dropped, "slaves that failed 6 tries in a row"),
        ("missing slave frames", int(silent.sum()), "no response"),
        ("bad slave frames", int((~response.isin([*_FINE, NO_ANSWER])).sum()), "bad responses"),
        ("protocol errors", int(unexpected.sum()), "responses that the call does not expect"),
        ("bad master frames", int((~request.isin(_FINE)).sum()), "bad requests"),
        ("repetitions", share, "share of the requests"),
    ]
    counted = pd.DataFrame(rows, columns=["counter", "value", "meaning"]).set_index("counter")
    counted["value"] = counted["value"].astype(float)
    limits = np.where(counted.index == "repetitions", _LIGHTS[1], 0.0)
    light = np.where(counted["value"] > limits, "red", "green").astype(object)
    light[(counted.index == "repetitions") & (light == "green") & (share > _LIGHTS[0])] = "yellow"
    light[counted["value"].isna()] = ""
    return counted.assign(light=light)[["value", "light", "meaning"]]


def _power_fails(capture: Capture) -> float:
    """Return how often the supply is too low for 250 us; NaN if AC coupled."""
    if np.isnan(capture.supply_voltage):
        return float("nan")
    length = max(1, min(len(capture.wave.u), round(250e-6 / capture.wave.dt)))
    whole = len(capture.wave.u) // length * length
    each = parts_of(capture.wave.u[:whole], 1000 * length)
    means = np.concatenate([part.reshape(-1, length).mean(axis=1) for _, part in each])
    low = np.abs(means) < POWER_FAIL
    return float(np.count_nonzero(np.diff(low, prepend=False) & low))


@checked
def decode(
    record: str | PathLike[str] | Waveform | npt.ArrayLike,
    dt: float | None = None,
    *,
    channel: str | None = None,
    sample_interval: float | None = None,
    threshold: float = 0.5,
    extended: Collection[int] = (),
) -> Capture:
    """Decode a recorded line voltage, from a scope's file or samples.

    Parameters
    ----------
    record : path, Waveform or array_like of float, shape (n_t,)
        A scope's file, which `shipnet.line.Waveform.read` reads, or the voltage between the wires
        in either polarity, with or without the supply's 30 V [V]; NaN where nothing was recorded.
    dt : float, optional
        Sampling interval, 0.1e-9..1e-6 [s]; for samples only, which need it.
    channel : str, optional
        Title or number of the channel of a file; the first with a voltage if omitted.
    sample_interval : float, optional
        Time between two samples [s]; it overrides what a file says.
    threshold : float, default 0.5
        Smallest pulse, relative to the telegram's first one, between 0 and 1.
    extended : collection of int, optional
        Addresses of A/B slaves, which the line does not show (see `Request.parse`).

    Returns
    -------
    Capture
        Table and summary; for a record that is not AS-i, the table is empty or has only errors.

    Raises
    ------
    InputError
        If a file cannot be read, or has no such channel.

    Notes
    -----
    The record is resampled to 4..8 MS/s and its baseline subtracted. A telegram ends where no pulse
    follows for 10.5 us; its length distinguishes requests from responses. The polarity with more
    telegrams free of errors is chosen. A response belongs to a request if it begins within 10 bit
    times after its end.

    Examples
    --------
    >>> from shipnet.asi import Modulation
    >>> t = np.arange(0, 300e-6, 1e-7)
    >>> current = Modulation("00101010111001").current(t, start=2e-5)
    >>> current += Modulation("0011001").current(t, start=12.2e-5)
    >>> capture = decode(30 - 40e-6 * np.gradient(current, 1e-7), 1e-7)
    >>> print(capture.transactions["text"][0])
    data exchange with slave 21: outputs 1110 (E); answer to data exchange: inputs 0110 (6)
    """
    if isinstance(record, str | PathLike):
        wave = Waveform.read(record, channel=channel, sample_interval=sample_interval)
    elif isinstance(record, Waveform):
        wave = record
    else:
        if dt is None:
            raise ArgumentError("dt is missing; samples need their sampling interval")
        _checked(record, dt)
        wave = Waveform(np.asarray(record), dt)
    u, dt = _checked(wave.u, wave.dt), wave.dt
    if not 0 < threshold < 1:
        raise ArgumentError(f"threshold is {threshold}; it must be between 0 and 1")
    for address in extended:
        if address not in range(1, 32):
            raise ArgumentError(f"extended has {address!r}; addresses are 1..31")
    found = find_telegrams(u, dt, threshold)
    table = transactions_of(found.telegrams, found.ends, extended)
    return Capture(
        table, len(u) * dt, found.inverted, found.minimum, found.disturbances, wave, tuple(extended)
    )


def _checked(u: npt.ArrayLike, dt: float) -> Floats:
    array = np.asarray(u)
    if array.ndim != 1 or array.size == 0 or array.dtype.kind not in "iuf":
        raise ArgumentError(
            f"record has the shape {array.shape} and the type {array.dtype}; it must be one row of "
            "real voltages"
        )
    if not 0.1e-9 <= dt <= 1.001 * _LONGEST_STEP:
        raise ArgumentError(
            f"dt is {dt} s; it must be 1e-10..1e-6 s, three samples a half-bit or more"
        )
    return array
