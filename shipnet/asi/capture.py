"""Decode recorded line voltages into telegrams and transactions, and assess the line."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field
from functools import cache, cached_property, partial
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from scipy.ndimage import binary_dilation

from shipnet import style
from shipnet.answers import MARGINS, Findings
from shipnet.arrays import Bools, Floats, Indices, parts_of
from shipnet.asi.batch import NONE, Requests, parse_responses
from shipnet.asi.bursts import Telegrams, find_telegrams
from shipnet.asi.causes import (
    CABLE,
    INDUCTANCE,
    INTERFERENCE,
    POWER,
    SILENT,
    WEAKER,
    Found,
    Restored,
    line_causes,
    plan_causes,
    ranked,
    restored,
    sender_causes,
    usual_levels,
)
from shipnet.asi.receiver import TOLERANCE
from shipnet.asi.rules import rule_limits
from shipnet.asi.telegram import REQUEST_BITS, RESPONSE_BITS, Call, Request, Response
from shipnet.asi.timing import BIT_TIME, MASTER_PAUSE_BITS
from shipnet.errors import ArgumentError, SilenceError, name_of
from shipnet.html import as_html
from shipnet.lazy import Axes, pd
from shipnet.line.waveform import Waveform

if TYPE_CHECKING:
    from shipnet.asi.plan import Plan

#: Values of the error columns besides "ok" and the names of error classes.
CUT_OFF, NO_ANSWER = "cut off", "no answer"

#: Longest pause between a request and its response [bit], including 0.5 bit times for the delay of
#: the pulses, and longest pause after a response [bit]: a master may extend it to 500 us.
_MASTER_PAUSE = MASTER_PAUSE_BITS[1] + 0.5
_SLAVE_PAUSE = 500e-6 / BIT_TIME

#: Values of the error columns by index: the names of the error codes, then the other values.
_STATES = [*map(name_of, range(SilenceError.code + 1)), CUT_OFF, NO_ANSWER, ""]


def transactions_of(
    telegrams: Telegrams, ends: Floats, extended: Collection[int] = ()
) -> pd.DataFrame:
    """Pair requests with responses, and return a table with one decoded transaction per row."""
    cut, asks, answers = _roles(telegrams)
    # Rows of the requests and responses in `telegrams`, -1 where a transaction has none.
    row = np.cumsum(~answers) - 1
    request, response = np.full((2, int((~answers).sum())), -1)
    request[row[asks]], response[row[~asks]] = np.flatnonzero(asks), np.flatnonzero(~asks)
    states = np.where(cut, _STATES.index(CUT_OFF), telegrams.error)
    request_error, response_error = (
        _pick(states, rows, _STATES.index("")) for rows in (request, response)
    )
    readable = request_error == 0
    words = np.where(readable, _pick(telegrams.word, request, 0), -1)
    calls = Requests.parse(words, extended=np.isin(words >> 7 & 31, list(extended)))
    request_error[readable] = calls.error[readable]
    replies = np.where(response_error == 0, _pick(telegrams.word, response, 0), -1)
    data, _ = parse_responses(replies)

    # The response to a request near the end of the recording is cut off, not missing.
    start = _pick(telegrams.start, request, np.nan)
    gap = np.append(ends, np.inf)[np.searchsorted(ends, start)] - start
    room = (REQUEST_BITS + MASTER_PAUSE_BITS[1] + RESPONSE_BITS) * BIT_TIME
    asks = np.array([call.rule.answer is not None for call in Call] + [False])[calls.call]
    alone = (response < 0) & (request_error == 0) & asks
    response_error[alone] = np.where(
        gap[alone] < room, _STATES.index(CUT_OFF), _STATES.index(NO_ANSWER)
    )

    # Few bit strings are distinct, so the columns are filled by indexing a list of them.
    titles, errors = pd.Index([*(call.rule.title for call in Call), ""]), pd.Index(_STATES)
    texts, which = _texts(telegrams)
    request_text, response_text = (
        _pick(which, rows, len(texts) - 1) for rows in (request, response)
    )
    # Add the columns one by one, so that only one column of a long record is in memory twice.
    table = pd.DataFrame(
        {"start_s": np.where(request >= 0, start, _pick(telegrams.start, response, np.nan))}
    )
    table["request"] = texts[request_text]
    table["call"] = titles[calls.call]
    whole = [
        pd.arrays.IntegerArray(values.astype(np.int64), values == NONE)
        for values in (calls.address, calls.data, data)
    ]
    table["address"], table["half"] = whole[0], pd.Index(["A", "B", ""])[calls.half]
    table["request_data"] = whole[1]
    table["response"], table["response_data"] = texts[response_text], whole[2]
    # The start of a telegram whose beginning is cut off is unknown.
    begins = np.where(cut & (telegrams.edge == 1), np.nan, telegrams.start)
    requested, answered = _pick(begins, request, np.nan), _pick(begins, response, np.nan)
    table["master_pause_bit"] = (answered - requested) / BIT_TIME - REQUEST_BITS
    pause = np.append((requested[1:] - answered[:-1]) / BIT_TIME - RESPONSE_BITS, np.nan)
    table["slave_pause_bit"] = np.where(pause <= _SLAVE_PAUSE, pause, np.nan)[: len(request)]
    for name in ("amplitude", "weakest", "ringing"):
        for kind, rows in (("request", request), ("response", response)):
            unit = "_V" if name == "amplitude" else ""
            table[f"{kind}_{name}{unit}"] = _pick(telegrams[name], rows, np.nan)
    table["request_error"], table["response_error"] = errors[request_error], errors[response_error]
    # The key does not contain the call, because the bits of a request determine it.
    sizes = len(texts), len(errors), len(texts), len(errors)
    key = np.ravel_multi_index((request_text, request_error, response_text, response_error), sizes)
    _, first, which = np.unique(key, return_index=True, return_inverse=True)
    some = table.iloc[first]
    halves, numbers = (calls.half[first] >= 0).tolist(), calls.call[first].tolist()
    ask, reply = ((some[kind], some[f"{kind}_error"]) for kind in ("request", "response"))
    sentences = map(_in_words, *ask, halves, *reply, numbers)
    table["text"] = pd.Categorical(list(sentences))[which]
    return table


def _pick(field: npt.NDArray[Any], index: Indices, missing: float) -> npt.NDArray[Any]:
    """Return the elements of `field` at `index`, or `missing` where the index is -1."""
    return np.where(index < 0, missing, field[index])


def _roles(telegrams: Telegrams) -> tuple[Bools, Bools, Bools]:
    """Return three masks: telegrams that are cut off, requests, and responses to a request."""
    # The last pulse of a telegram precedes the first of the next by the pause plus one bit time.
    pause = np.diff(telegrams.first, prepend=np.nan)
    pause[1:] = (telegrams.first[1:] - telegrams.last[:-1]) / BIT_TIME - 1
    broken = (telegrams.error > 0) | ~telegrams.fits
    short = telegrams.length == RESPONSE_BITS
    # A request that is cut off at its start or its end may look like a response.
    front = (telegrams.edge == 1) & (broken | short)
    asks = ~short | front
    in_time = np.append(False, asks[:-1]) & (pause <= _MASTER_PAUSE)
    back = (telegrams.edge == 2) & ~front & (broken | (short & ~in_time))
    asks = np.where(back, ~in_time, asks)
    return front | back, asks, ~asks & np.append(False, asks[:-1]) & (pause <= _MASTER_PAUSE)


def _texts(telegrams: Telegrams) -> tuple[pd.Index[str], Indices]:
    """Return the distinct bit strings, the last one "", and the index of each telegram's string.

    A string contains 0 and 1, and ? for each bit that could not be received.
    """
    mask = (1 << REQUEST_BITS) - 1
    key = telegrams.length.astype(np.int64) << REQUEST_BITS | telegrams.known
    which, different = pd.factorize(key << REQUEST_BITS | telegrams.word)
    texts = []
    for code in different.tolist():
        length = code >> 2 * REQUEST_BITS
        bits, received = f"{code & mask:0{length}b}", f"{code >> REQUEST_BITS & mask:0{length}b}"
        pairs = zip(bits, received, strict=True)
        texts.append("".join(bit if one == "1" else "?" for bit, one in pairs))
    return pd.Index([*texts, ""]), which


def _in_words(
    request: str, request_error: str, extended: bool, response: str, response_error: str, call: int
) -> str:
    """Return a one-line description of a request and its response, or of their errors."""
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


#: Supply voltage below which a power fail is counted [V] (Bihl+Wiedemann's tuner), and mean voltage
#: up to which a record counts as AC coupled [V]; duration of a mean [s].
POWER_FAIL, _COUPLED, _MEAN = 18.5, 5.0, 250e-6


@cache
def _limits() -> tuple[float, float, float, float]:
    """Return the limits of the first pulse (half the peak-to-peak limits) and of the supply [V]."""
    limits = rule_limits()
    low, high = limits["low"], limits["high"]
    level = low["signal_level_least"] / 2, high["signal_level_most"] / 2
    return *level, low["slave_voltage"], high["supply_voltage"]


#: Longest time from a request to its repetition [s]; a later request belongs to the next cycle.
_AT_ONCE = 1e-3

#: Largest difference between the start times of a request before and after restoration [s].
_SAME = 4e-6

#: Calls with which a master searches for new slaves; no response is expected from a vacant address.
_IDENTIFICATION = [
    call.rule.title
    for call in (Call.READ_IO_CONFIGURATION, Call.READ_ID, Call.READ_ID1, Call.READ_ID2)
]

#: Largest fraction of repetitions for a green and a yellow light (P+F, AS-i 3.0 command interface).
_LIGHTS = 0.01, 0.05

#: Calls that do not show whether the master expects a slave: it may also search with a status.
_SEARCH = [*_IDENTIFICATION, Call.READ_STATUS.rule.title]

#: Largest number of data exchanges in a row without a response: the repetition must have one.
_UNANSWERED = 1.0
_MISSING = "missing responses in a row"

#: Name used for the slave if the address in a request cannot be read.
UNKNOWN = "unknown"

_FINE = ["ok", "", CUT_OFF]


@dataclass(frozen=True)
class Summary:
    """The main results of a capture."""

    transactions: int
    cycle_time: float
    repetitions: int
    unanswered: int
    seen: list[str]
    missing: list[str]
    #: Labels of addresses at which the master searched for new slaves and found none.
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
                f"no slave at    {', '.join(self.vacant) or '-'} (the master looks for new slaves)",
                f"errors         {errors or 'none'}",
            ]
        )


def _repeated(transactions: pd.DataFrame) -> Bools:
    """Return a mask of the rows that repeat a request which failed in the previous row."""
    request, start = transactions["request"].to_numpy(), transactions["start_s"].to_numpy()
    states = transactions[["request_error", "response_error"]]
    failed = (~states.isin(_FINE)).any(axis=1).to_numpy()
    repeated = np.zeros(len(request), dtype=bool)
    for row in np.flatnonzero(failed[:-1]) + 1:
        before, now = request[row - 1], request[row]
        if before and len(before) == len(now) and start[row] - start[row - 1] < _AT_ONCE:
            repeated[row] = sum(a not in ("?", b) for a, b in zip(before, now, strict=True)) <= 1
    return repeated


def _slaves(transactions: pd.DataFrame, requests: pd.DataFrame) -> pd.DataFrame:
    """Return a table with one row per addressed slave and one for unreadable addresses."""
    rows = transactions.assign(slave=requests["slave"])[requests["slave"] != ""]
    response = rows["response_error"]
    responses = rows[(rows["response"] != "") & (response != CUT_OFF)].groupby("slave")
    counted = {
        "requests": rows["request"] != "",
        "answers": response == "ok",
        "unanswered": response == NO_ANSWER,
        "bad_requests": ~rows["request_error"].isin(_FINE),
        "errors": ~response.isin([*_FINE, NO_ANSWER]),
    }
    table = pd.DataFrame(
        {name: mask.groupby(rows["slave"]).sum() for name, mask in counted.items()}
    )
    table.insert(3, "polled", (~requests["call"].isin(_SEARCH)).groupby(rows["slave"]).any())
    table["amplitude_V"] = responses["response_amplitude_V"].median()
    table["weakest_pulse"] = responses["response_weakest"].min()
    table["ringing"] = responses["response_ringing"].max()
    order = sorted(table.index, key=lambda name: (name == UNKNOWN, len(name.rstrip("AB")), name))
    return table.loc[order].rename_axis("slave")


def _series(failed: pd.Series, slave: pd.Series) -> dict[str, list[int]]:
    """Return the number of failures before each slave's first success, between two, and after."""
    return {
        str(name): [len(run) for run in "".join(map("01".__getitem__, tries)).split("0")]
        for name, tries in failed.groupby(slave, sort=False)
    }


#: Longest sampling interval [s]: three samples per half-bit.
_LONGEST_STEP = 1e-6


@dataclass(frozen=True)
class Capture:
    """The telegrams and transactions decoded from a recorded line voltage.

    Attributes
    ----------
    transactions : pandas.DataFrame
        Table with one row per transaction, sorted by time:

        - ``start_s``: start of the request, or of the response if there is no request [s];
        - ``request``, ``response``: bits, ``?`` if unreadable; "" if there is no telegram;
        - ``call``, ``address``, ``half`` ("A", "B" or ""), ``request_data``, ``response_data``:
          decoded fields; empty for a bad telegram;
        - ``master_pause_bit``, ``slave_pause_bit``: pauses after request and response [bit];
        - ``request_amplitude_V``, ``response_amplitude_V``: height of the first pulse [V];
        - ``request_weakest``, ``request_ringing`` (and ``response_...``): as in `Reception`;
        - ``request_error``, ``response_error``: "ok", name of an error class, "cut off" at a gap or
          an end of the record, "no answer", or "" where no telegram is expected;
        - ``text``: description of the transaction, a categorical column.
    duration : float
        Duration of the record [s].
    inverted : bool
        True if the probe was connected with reversed polarity.
    minimum : float
        Smallest voltage that counted as a pulse [V].
    disturbances : int
        Number of bursts with too few pulses for a telegram.
    wave : shipnet.line.Waveform
        The recorded line voltage.
    extended : tuple of int
        Addresses of the A/B slaves, 1..31.

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

    def _repr_html_(self) -> str:
        findings, rows = self.check(), self.transactions
        faulty = ~rows[["request_error", "response_error"]].isin(_FINE).all(axis=1)
        first = rows["start_s"][faulty if faulty.any() else slice(None)].head(1).sum()
        plot = partial(self.plot, start=max(0.0, first - 50e-6), stop=first + 400e-6)
        return as_html(self, findings.worst()[MARGINS], ok=findings.ok, plot=plot)

    @property
    def telegrams(self) -> int:
        """Number of telegrams received without errors."""
        columns = self.transactions[["request_error", "response_error"]]
        return int((columns == "ok").to_numpy().sum())

    def table(self) -> pd.DataFrame:
        """Return a copy of `transactions`, the table with one row per transaction."""
        return self.transactions.copy()

    @property
    def slaves(self) -> pd.DataFrame:
        """Responses, errors, level, evenness and ringing of each slave that is polled or responds.

        Requests that cannot be attributed to a slave are counted in the row ``"unknown"``.
        """
        return self.summary().slaves

    @cached_property
    def _middle(self) -> float:
        step = max(1, len(self.wave.u) // 100_000)
        looks = [part[::step].copy() for _, part in parts_of(self.wave.u, 1000 * step)]
        some = np.concatenate(looks)
        some = some[~np.isnan(some)]
        return float(np.median(some)) if len(some) else 0.0

    @cached_property
    def _means(self) -> Floats:
        """Magnitude of the mean voltage of each 250 us [V], NaN if it contains a gap."""
        length = max(1, min(len(self.wave.u), round(_MEAN / self.wave.dt)))
        whole = len(self.wave.u) // length * length
        each = parts_of(self.wave.u[:whole], 1000 * length)
        means = [part.reshape(-1, length).mean(axis=1) for _, part in each]
        return np.asarray(np.abs(np.concatenate(means)))

    @property
    def supply_voltage(self) -> float:
        """Supply voltage for most of the record [V]; NaN if the record is AC coupled."""
        return abs(self._middle) if np.mean(self._means > _COUPLED) > 0.1 else float("nan")

    def check(self, plan: Plan | None = None) -> Findings:
        """Check level, evenness, ringing and errors of requests and responses against limits.

        The level is the height of the first pulse; its limits are 1.5 V and, for responses, 4 V
        (half of 3 V and 8 V peak to peak). The supply is checked if the record is DC coupled. A
        slave may leave one data exchange without a response, but not the next one, too; requests
        with which the master searches for new slaves do not count. A slave's level must be at least
        65 % of its usual level: the median of all slaves, or with a `plan`, the level that the plan
        gives at the master relative to the others. All slaves of the plan must have responded, and
        no others. A/B slaves need `decode(..., extended=...)`.
        """
        return Findings(_judged(self, plan))

    def causes(self, plan: Plan | None = None) -> pd.DataFrame:
        """Return the probable causes of the line's faults, the most likely one first.

        The table has one row per cause and is empty for a healthy line. `slave` is the slave
        concerned, if any; `share` is the fraction of the violated findings of `check` that the
        cause explains, 0..1; `evidence` gives the reason. Possible causes are a power fail, a long
        cable or a stub, a second supply, a missing or wrong supply inductance, interference, a
        duplicate address, a weak slave, a slave that does not respond, a reversed probe, and with a
        `plan`, a missing or an unexpected slave.

        The rules use the impedance of the line: a second supply halves its resistance and
        inductance; a long cable or a stub adds capacitance and echoes. Only one of several faults
        that change the impedance is named. The impedance is less accurate if the scope is at a
        slave, and a plan's levels apply only to a scope at the master. The rules were derived from
        simulated lines and tested on other simulated lines; a real line may differ.

        Examples
        --------
        >>> from shipnet.asi import line
        >>> plan = line(60, slaves=(10, 30, 60))
        >>> decode(plan.record(10e-3, weak={"2": 0.4}, rng=2024)).causes()["slave"].to_dict()
        {'weak slave': '2'}
        """
        broken = self.check(plan).violated()
        causes: list[Found] = []
        if len(broken) or self.disturbances:
            powered = self._powered
            answering = int((self.slaves["answers"] > 0).sum())
            line = powered._restored, powered.transactions, answering, powered.disturbances
            causes = line_causes(*line, self.supply_voltage)
            kinds = {one.cause for one in causes}
            clear = powered._clear if causes else powered
            power = _power_cause(self)
            usual = usual_levels(clear.slaves, plan)
            senders = sender_causes(clear.slaves, usual, clear.disturbances, clear._silences)
            explained = set()
            # What silences most slaves is a fault of the line.
            silent = [one.cause for one in senders].count(SILENT)
            if (power or causes) and 2 * silent > len(clear._silences):
                explained.add(SILENT)
            # A wrong cable or inductance explains bad telegrams, but not bursts between good ones,
            # and an inductance does not explain that some requests are good and others bad.
            bursts = clear.disturbances
            if CABLE not in kinds:
                bursts += int(clear.slaves["bad_requests"].sum())
            if {CABLE, INDUCTANCE} & kinds and not 2 <= bursts <= 2 * clear.telegrams:
                explained.add(INTERFERENCE)
            causes = power + causes + [one for one in senders if one.cause not in explained]
            causes += plan_causes(broken, [one.slave for one in causes])
        return ranked(causes, broken, self.inverted)

    def first_sign(self, cause: str, slave: str = "") -> float:
        """Return the start of the first telegram [s] that shows a cause of `causes`."""
        rows = self.transactions
        if cause == POWER and len(fails := _power_fails(self)):
            return float(fails[0])
        if rows.empty:
            return 0.0
        # The master expects no response where it searches for new slaves.
        concerned = (
            self._requests["slave"] == slave if slave else rows["response_error"] != NO_ANSWER
        )
        bad = ~rows[["request_error", "response_error"]].isin(_FINE).all(axis=1)
        sign = concerned & bad if (concerned & bad).any() else concerned & bool(slave)
        return float(rows["start_s"][sign if sign.any() else slice(None)].min())

    def counters(self) -> pd.DataFrame:
        """Return the counters that masters and analysers show, each with value, light and meaning.

        The repetitions light is green up to 1 % of the requests, yellow up to 5 % and red
        above that; all other lights are green only at 0. Unknown values are NaN and have no light.

        Examples
        --------
        >>> from shipnet.asi import line
        >>> counters = decode(line(60, slaves=3).record(10e-3, rng=2024)).counters()
        >>> counters.loc[["missing slave frames", "repetitions"], "light"].tolist()
        ['green', 'green']
        """
        return _counted(self)

    @style.applied
    def plot(
        self, ax: Axes | None = None, *, start: float = 0.0, stop: float | None = None
    ) -> Axes:
        """Draw the record from `start` to `stop` [s], its telegrams (shaded) and their bits.

        Errors are named above the bits. If the bits would overlap, they are omitted, and telegrams
        with errors are red. Two lines show the smallest legal height of a first pulse.
        """
        ax = style.axes(ax, figsize=(6.4, 3.2))
        u, dt = self.wave.u, self.wave.dt
        stop = len(u) * dt if stop is None else stop
        low, high = max(0, int(start / dt)), min(len(u), int(stop / dt) + 1)
        # A figure has fewer pixels than samples: draw only the extremes of each group of samples.
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
        beside: dict[str, Any] = {"transform": ax.get_yaxis_transform(), "va": "center"}
        ax.text(1.01, zero - least, f"{least:g} V", color=colour, **beside)
        ends, red = ax.get_xaxis_transform(), style.LIMIT["color"]
        per_inch = (stop - start) * ax.figure.dpi / ax.bbox.width
        legible, named = per_inch < 16 * BIT_TIME, -np.inf
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
                if error != "ok" and not legible:
                    colour = red
                ends_us = begin * 1e6, (begin + length) * 1e6
                ax.axvspan(*ends_us, color=colour, alpha=0.5, linewidth=0)
                there: dict[str, Any] = {"transform": ends, "ha": "center"}
                if legible:
                    ax.text(middle * 1e6, 1.02, bits, family="monospace", **there)
                if error != "ok" and middle - named > per_inch:
                    ax.text(middle * 1e6, 1.1 if legible else 1.02, error, color=red, **there)
                    named = middle
        ax.set(xlim=(start * 1e6, stop * 1e6), xlabel="time [µs]", ylabel="voltage [V]")
        return ax

    def __str__(self) -> str:
        lines = [str(self.summary())]
        for cause, slave, _, evidence in self.causes().itertuples():
            lines.append(f"probable cause {f'{cause} {slave}'.rstrip()}: {evidence}")
        return "\n".join(lines)

    def summary(self) -> Summary:
        """Return the main results, such as cycle time, repetitions, missing slaves and errors."""
        return self._summary

    @cached_property
    def _summary(self) -> Summary:
        transactions = self.transactions
        states = transactions[["request_error", "response_error"]].to_numpy()
        faults = [state for state in states.ravel() if state not in (*_FINE, NO_ANSWER)]
        repeated = _repeated(transactions)
        slaves = _slaves(transactions, self._requests)
        exchanges = (self._requests["call"] == "data exchange") & ~repeated
        times = transactions["start_s"].where(exchanges).dropna()
        addressed = slaves[slaves.index != UNKNOWN]
        silent = addressed[(addressed["answers"] == 0) & (addressed["unanswered"] > 0)]
        return Summary(
            len(transactions),
            float(times.groupby(self._requests["slave"]).diff().median()),
            int(repeated.sum()),
            int((transactions["response_error"] == NO_ANSWER).sum()),
            list(addressed.index[addressed["answers"] > 0]),
            list(silent.index[silent["polled"]]),
            list(silent.index[~silent["polled"]]),
            {name: faults.count(name) for name in sorted(set(faults))},
            int((states == CUT_OFF).sum()),
            slaves.drop(silent.index[~silent["polled"]]).drop(columns=["unanswered", "polled"]),
        )

    @cached_property
    def _restored(self) -> Restored:
        """Requests in the first 40 ms of traffic, read after removing the cable's distortion."""
        rows = self.transactions
        requests = rows[(rows["request"].str.len() == REQUEST_BITS) & rows["start_s"].notna()]
        good = rows[rows["request_error"] == "ok"]
        words = np.array([int(bits, 2) for bits in good["request"]], np.int64)
        starts = requests["start_s"].to_numpy(), good["start_s"].to_numpy()
        return restored(self.wave.u, self.wave.dt, *starts, words, self.inverted)

    @cached_property
    def _clear(self) -> Capture:
        """The capture of the restored pulses if more of its telegrams can be read, or this one."""
        if not len(self._restored.pulses):
            return self
        clear = decode(self._restored.pulses, self._restored.step, extended=self.extended)
        return max(self, clear, key=lambda one: one.telegrams / max(1, len(one.transactions)))

    @cached_property
    def _powered(self) -> Capture:
        """The capture without the times at which the supply fails, or this one if it never does.

        While the supply falls and rises, telegrams are cut off and bursts appear.
        """
        length = len(self.wave.u) / len(self._means)
        low = binary_dilation(self._means < POWER_FAIL, iterations=3)
        if np.isnan(self.supply_voltage) or low.all() or not low.any():
            return self
        block = np.minimum(np.arange(len(self.wave.u)) / length, len(low) - 1).astype(int)
        u = np.where(low[block], np.nan, self.wave.u)
        return decode(u, self.wave.dt, extended=self.extended)

    @cached_property
    def _requests(self) -> pd.DataFrame:
        """Slave and call of each transaction, including each bad request that can be restored."""
        rows = self.transactions
        address = rows["address"].astype(object).fillna(NONE).to_numpy(np.int64)
        half, calls = rows["half"].tolist(), rows["call"].tolist()
        names = [UNKNOWN if a == NONE else f"{a}{h}" for a, h in zip(address, half, strict=True)]
        names = ["" if c == "broadcast reset" else n for c, n in zip(calls, names, strict=True)]
        requests = pd.DataFrame({"slave": names, "call": calls}, index=rows.index, dtype=object)
        bad = ~rows["request_error"].isin(_FINE).to_numpy()
        if not bad.any() or not len(self._restored.start):
            return requests
        there, words = self._restored.start, self._restored.words
        read = Requests.parse(words, extended=np.isin(words >> 7 & 31, self.extended))
        start = rows["start_s"].to_numpy()
        near = np.minimum(np.searchsorted(there, start - _SAME), len(there) - 1)
        near[~(np.abs(start - there[near]) < _SAME) | (read.error[near] > 0) | ~bad] = -1
        # Bad requests with the same received bits are taken to be the same request.
        texts = rows["request"].tolist()
        meant = {texts[row]: int(near[row]) for row in np.flatnonzero(near >= 0)}
        for row in np.flatnonzero(bad & rows["request"].isin(meant).to_numpy()):
            k = meant[texts[row]]
            names[row] = f"{read.address[k]}{('A', 'B', '')[read.half[k]]}"
            calls[row] = Call(int(read.call[k])).rule.title
        return requests.assign(slave=names, call=calls)

    @cached_property
    def _silences(self) -> dict[str, list[int]]:
        """Numbers of data exchanges without a response, by slave; see `_series`."""
        rows, (slave, call) = self.transactions, (self._requests["slave"], self._requests["call"])
        response = rows["response_error"]
        data = (call == "data exchange") & (rows["request_error"] == "ok") & (response != CUT_OFF)
        return _series((response == NO_ANSWER)[data], slave[data])


def _judged(capture: Capture, plan: Plan | None) -> pd.DataFrame:
    """Return the findings of `Capture.check` as a table for `Findings`."""
    nan, table, slaves = float("nan"), capture.transactions, capture.slaves
    volts, read = capture.supply_voltage, float(capture.telegrams)
    rows = [("telegrams", "line", read, 1.0, nan, "1", "telegrams read")]
    if not np.isnan(volts):
        rows.append(("supply voltage", "supply", volts, *_limits()[2:], "V", "at the scope"))
    requests = table[~table["request_error"].isin(["", CUT_OFF])]
    level, weakest = requests["request_amplitude_V"].min(), requests["request_weakest"].min()
    bad = float((requests["request_error"] != "ok").sum())
    least, most, *_ = _limits()
    # The level of requests has no upper limit: it may be higher at the master than elsewhere.
    measurements = [
        ("request", "master", least, nan, level, weakest, requests["request_ringing"].max(), bad)
    ]
    usual = usual_levels(slaves, plan)
    for name, *values in slaves[["amplitude_V", "weakest_pulse", "ringing", "errors"]].itertuples():
        if name != UNKNOWN:
            low = float(np.fmax(least, round(WEAKER * usual[name], 2)))
            measurements.append(("response", f"slave {name}", low, most, *values))
    for kind, who, least, most, level, weakest, ringing, bad in measurements:
        for what, value, low, high, unit in (
            ("level", level, least, most, "V"),
            ("evenness", weakest, TOLERANCE.evenness, nan, "1"),
            ("ringing", ringing, nan, TOLERANCE.ringing, "1"),
            ("errors", bad, nan, 0.0, "1"),
        ):
            if not np.isnan(value):
                why = f"{kind}s of {who}"
                rows.append((f"{kind} {what}", who, float(value), low, high, unit, why))
    for name, series in capture._silences.items():
        longest, why = float(max(series)), "the repetition of a data exchange needs a response"
        if series == [1]:
            longest, why = nan, "one data exchange without a response; record more cycles"
        rows.append((_MISSING, f"slave {name}", longest, nan, _UNANSWERED, "1", why))
    if plan is not None:
        planned = dict.fromkeys(slave.label for slave in plan.slaves)
        others = [name for name in slaves.index[slaves["answers"] > 0] if name not in planned]
        for name in [*planned, *others]:
            count = float(slaves["answers"].get(name, 0))
            low, high = (1.0, nan) if name in planned else (nan, 0.0)
            why = "it is in the plan" if name in planned else "it is not in the plan"
            rows.append(("answers", f"slave {name}", count, low, high, "1", why))
    columns = ["rule", "object", "value", "low", "high", "unit", "why"]
    findings = pd.DataFrame(rows, columns=columns)
    missed = (findings["value"] < findings["low"]) | (findings["value"] > findings["high"])
    judged = np.where(missed, "violated", "met")
    findings["verdict"] = np.where(findings["value"].isna(), "not verified", judged)
    findings["source"] = "IEC 62026-2 as quoted by SAP5S/SAP51, 2012, p. 29; kim2023, section 3.4"
    findings.loc[findings["rule"] == "supply voltage", "source"] = "ifm AC2904; SEW 31545580"
    findings.loc[findings["rule"] == _MISSING, "source"] = "Beckhoff EL6201, operating phases"
    return findings


def _counted(capture: Capture) -> pd.DataFrame:
    """Return the table of `Capture.counters`."""
    table, summary = capture.transactions, capture.summary()
    slave, call = capture._requests["slave"], capture._requests["call"]
    request, response = table["request_error"], table["response_error"]
    silent = (response == NO_ANSWER) & ~call.isin(_IDENTIFICATION) & ~slave.isin(summary.vacant)
    data = (call == "data exchange") & (slave != UNKNOWN)
    failed = _series((~request.isin(_FINE) | ~response.isin(_FINE))[data], slave[data])
    # A master drops a slave after two failed tries in each of three consecutive cycles.
    dropped = sum(run >= 6 for series in failed.values() for run in series)
    unexpected = table["text"].str.endswith("where none is expected")
    requests = int((table["request"] != "").sum())
    nan = float("nan")
    fails = nan if np.isnan(capture.supply_voltage) else len(_power_fails(capture))
    share = summary.repetitions / requests if requests else nan
    rows = [
        ("power fail", fails, f"times that the supply falls below {POWER_FAIL} V"),
        ("earth fault", nan, "not visible between the two wires; measure each wire to earth"),
        ("slave failure", dropped, "times that a slave failed 6 tries in a row"),
        ("missing slave frames", int(silent.sum()), "no response"),
        ("bad slave frames", int((~response.isin([*_FINE, NO_ANSWER])).sum()), "bad responses"),
        ("protocol errors", int(unexpected.sum()), "responses where none is expected"),
        ("bad master frames", int((~request.isin(_FINE)).sum()), "bad requests"),
        ("repetitions", share, "fraction of the requests"),
    ]
    counted = pd.DataFrame(rows, columns=["counter", "value", "meaning"]).set_index("counter")
    counted["value"] = counted["value"].astype(float)
    limits = np.where(counted.index == "repetitions", _LIGHTS[1], 0.0)
    light = np.where(counted["value"] > limits, "red", "green").astype(object)
    light[(counted.index == "repetitions") & (light == "green") & (share > _LIGHTS[0])] = "yellow"
    light[counted["value"].isna()] = ""
    return counted.assign(light=light)[["value", "light", "meaning"]]


def _power_fails(capture: Capture) -> Floats:
    """Return the times [s] at which the supply falls below `POWER_FAIL`."""
    low = capture._means < POWER_FAIL
    return np.asarray(np.flatnonzero(np.diff(low, prepend=False) & low) * _MEAN)


def _power_cause(capture: Capture) -> list[Found]:
    """Return a power fail that is visible in the voltage, or if no slave responds any more."""
    volts, least = capture.supply_voltage, _limits()[2]
    if np.isnan(volts):
        last = [series[-1] for series in capture._silences.values()]
        why = f"none of {len(last)} slaves responds any more; the record does not show the supply"
        return [Found(POWER, why)] if len(last) > 1 and min(last) > 1 else []
    fails = _power_fails(capture)
    if len(fails):
        why = f"the supply falls below {POWER_FAIL} V at {1e3 * fails[0]:.1f} ms"
        if len(fails) > 1:
            why += f" and {len(fails) - 1} times later"
    else:
        why = f"the supply is {volts:.1f} V; slaves need {least} V"
    return [Found(POWER, why)] if len(fails) or volts < least else []


def decode(
    record: str | PathLike[str] | Waveform | npt.ArrayLike,
    dt: float | None = None,
    *,
    channel: str | None = None,
    sample_interval: float | None = None,
    threshold: float = 0.5,
    extended: Collection[int] = (),
) -> Capture:
    """Decode the line voltage in an oscilloscope file, a waveform or an array of samples.

    Parameters
    ----------
    record : path, Waveform or array_like of float, shape (n_t,)
        A file that `shipnet.line.Waveform.read` accepts, a waveform, or samples of the voltage
        between the wires [V] in either polarity, with or without the supply's 30 V; NaN in gaps.
    dt : float, optional
        Sampling interval, 0.1e-9..1e-6 [s]; required for an array and ignored otherwise.
    channel : str, optional
        Title or number of the file's channel; by default the first voltage channel.
    sample_interval : float, optional
        Sampling interval that replaces the one in the file [s].
    threshold : float, default 0.5
        Smallest height of a pulse, relative to the telegram's first pulse; above 0 and below 1.
    extended : collection of int, optional
        Addresses of A/B slaves, which cannot be inferred from telegrams (see `Request.parse`).

    Returns
    -------
    Capture
        Decoded record; without AS-i traffic, its table is empty or contains only errors.

    Raises
    ------
    InputError
        If the file cannot be read or does not contain the channel.

    Notes
    -----
    The record is resampled to 4..8 MS/s, and its baseline is subtracted. A telegram ends if no
    pulse follows for 10.5 us; its length shows whether it is a request or a response. Of the two
    polarities, the one with more error-free telegrams is chosen. A response belongs to a request
    if it begins at most 10 bit times after the end of the request.

    Examples
    --------
    >>> from shipnet.asi import Modulation
    >>> t = np.arange(0, 300e-6, 1e-7)
    >>> current = Modulation("00101010111001").current(t, start=2e-5)
    >>> current += Modulation("0011001").current(t, start=12.2e-5)
    >>> capture = decode(30 - 40e-6 * np.gradient(current, 1e-7), 1e-7)
    >>> print(capture.transactions["text"][0])
    data exchange with slave 21: outputs 1110 (E); response to data exchange: inputs 0110 (6)
    """
    if isinstance(record, str | PathLike):
        wave = Waveform.read(record, channel=channel, sample_interval=sample_interval)
    elif isinstance(record, Waveform):
        wave = record
    else:
        if dt is None:
            raise ArgumentError("dt is missing; an array of samples needs a sampling interval")
        _checked(record, dt)
        wave = Waveform(np.asarray(record), dt)
    u, dt = _checked(wave.u, wave.dt), wave.dt
    if not 0 < threshold < 1:
        raise ArgumentError(f"threshold is {threshold}; it must be between 0 and 1")
    for address in extended:
        if address not in range(1, 32):
            raise ArgumentError(f"extended contains {address!r}; addresses must be 1..31")
    decoded = find_telegrams(u, dt, threshold)
    table = transactions_of(decoded.telegrams, decoded.ends, extended)
    return Capture(table, len(u) * dt, *decoded[2:], wave, tuple(extended))


def _checked(u: npt.ArrayLike, dt: float) -> Floats:
    array = np.asarray(u)
    if array.ndim != 1 or array.size == 0 or array.dtype.kind not in "iuf":
        raise ArgumentError(
            f"record has shape {array.shape} and dtype {array.dtype}; it must be a non-empty 1-D "
            "array of real voltages"
        )
    if not 0.1e-9 <= dt <= 1.001 * _LONGEST_STEP:
        raise ArgumentError(
            f"dt is {dt} s; it must be 1e-10..1e-6 s: at least three samples per half-bit"
        )
    return array
