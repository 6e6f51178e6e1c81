"""Decode a recorded line voltage: from the samples of a scope to a table of transactions."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

import numpy as np
import numpy.typing as npt

from shipnet.asi.apm import HALF_BIT
from shipnet.asi.bursts import Bursts, Piece, find_bursts, pieces, smallest_pulses
from shipnet.asi.capture_summary import Summary, summarize
from shipnet.asi.frame import REQUEST_BITS, RESPONSE_BITS
from shipnet.asi.receiver import receive
from shipnet.asi.transactions import Telegrams, transactions_of
from shipnet.errors import ArgumentError

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["Capture", "decode"]

Floats = npt.NDArray[np.float64]

#: Longest time between two samples [s]: three samples a half-bit.
_LONGEST_STEP = 1e-6

#: Largest voltage that is taken for one [V].
_LARGEST = 1e9

#: Length of a piece by which the record is measured [s], and how many there are.
_SAMPLE, _SAMPLES = 2e-3, 8

#: Samples from before the first peak and behind the last slot that the receiver gets [s].
_BEFORE, _BEHIND = 5e-6, 1e-6

#: The first pulse is looked for from this part of its own height on; ringing stays below.
_FIRST_PULSE = 0.4

#: Recording that begins or ends so near to a telegram may have missed a pulse of it [s]: pulses
#: are two half-bits apart at most.
_NEAR = 2.5 * HALF_BIT

#: Fewest pulses that are told as a broken telegram; with fewer it is a disturbance.
_FEWEST_PULSES = 5


@dataclass(frozen=True)
class Capture:
    """What was decoded.

    Attributes
    ----------
    transactions : pandas.DataFrame
        One row a transaction, in the order of time:

        - ``start_s``: start of the request, or of the response if there is no request, from the
          first sample [s];
        - ``request``, ``response``: bits in the order sent; ``?`` where there was no pulse,
          ``""`` without a telegram;
        - ``call``, ``address``, ``half`` ("A", "B" or ""), ``request_data``, ``response_data``:
          what they say; empty for a bad telegram;
        - ``master_pause_bit``, ``slave_pause_bit``: pauses behind request and response [bit];
        - ``request_amplitude_V``, ``response_amplitude_V``: size of the first pulse;
        - ``weakest_pulse``, ``ringing``: as in `shipnet.asi.receiver.Reception`, over the largest
          pulse; of the response, or of the request if there is no response;
        - ``request_error``, ``response_error``: ``"ok"``, a class of `shipnet.errors`,
          ``"cut off"`` at an end of the record, ``"no answer"``, or ``""`` where no telegram is
          expected;
        - ``text``: the transaction in words.
    duration : float
        Length of the record [s].
    inverted : bool
        Whether the probe was the wrong way round.
    minimum : float
        Voltage below which nothing counted as a pulse [V].
    disturbances : int
        Bursts of too few pulses for a telegram.
    """

    transactions: pd.DataFrame
    duration: float
    inverted: bool
    minimum: float
    disturbances: int
    _summary: list[Summary] = field(default_factory=list, repr=False, compare=False)

    @property
    def telegrams(self) -> int:
        """How many telegrams were received without an error."""
        columns = self.transactions[["request_error", "response_error"]]
        return int((columns == "ok").to_numpy().sum())

    def summary(self) -> Summary:
        """Return cycle time, repetitions, missing slaves, errors and margins.

        Returns
        -------
        Summary
            See there; printed, it is a report of a few lines.
        """
        if not self._summary:
            self._summary.append(summarize(self.transactions))
        return self._summary[0]


def decode(
    u: npt.ArrayLike,
    dt: float,
    *,
    threshold: float = 0.5,
    extended: Collection[int] = (),
    minimum: float | None = None,
) -> Capture:
    """Decode a recorded line voltage.

    Parameters
    ----------
    u : array_like of float, shape (n_t,)
        Voltage between the two wires, either way round, on the 30 V of the supply or without
        [V]. NaN where nothing was recorded.
    dt : float
        Sampling interval, 0.1e-9..1e-6 [s].
    threshold : float, default 0.5
        What counts as a pulse, over the size of the telegram's first pulse, between 0 and 1.
    extended : collection of int, optional
        Addresses that hold A/B slaves; nothing on the line tells (see `Request.parse`).
    minimum : float, optional
        Voltage below which nothing is a pulse [V]; estimated from the noise in the pauses and
        from the size of the pulses if omitted.

    Returns
    -------
    Capture
        Table and summary. What is not AS-i gives an empty table, or errors only.

    Raises
    ------
    ArgumentError
        If `u` is not one row of real numbers within 1e9 V, or an argument is out of range.

    Notes
    -----
    The record is brought to 4..8 MS/s and freed of its baseline. A telegram ends where no pulse
    follows for 10.5 us; whether it is a request or a response is told by its length, and then
    `shipnet.asi.receiver.receive` decodes all of a piece at once. Of the two polarities the one
    is right in which more telegrams are free of errors, since the first pulse is negative. A
    response belongs to a request if it begins within 10 bit times after its end.

    Examples
    --------
    >>> from shipnet.asi.apm import send_current
    >>> t = np.arange(0, 300e-6, 1e-7)
    >>> current = send_current(t, "00101010111001", start=2e-5)
    >>> current += send_current(t, "0011001", start=12.2e-5)
    >>> capture = decode(30 - 40e-6 * np.gradient(current, 1e-7), 1e-7)
    >>> print(capture.transactions["text"][0])
    data exchange with slave 21: outputs 1110 (E); answer to data exchange: inputs 0110 (6)
    >>> float(capture.transactions["master_pause_bit"][0].round(2))
    3.0
    """
    u = _checked(u, dt)
    if not 0 < threshold < 1:
        raise ArgumentError(f"threshold is {threshold}; it must lie between 0 and 1")
    if minimum is not None and not 0 < minimum < np.inf:
        raise ArgumentError(f"minimum is {minimum} V; it must be positive")
    for address in extended:
        if address not in range(1, 32):
            raise ArgumentError(f"extended holds {address!r}; addresses are 1..31")
    sample = list(pieces(u, dt, length=round(_SAMPLE / dt), only=_liveliest(u, dt)))
    limits = smallest_pulses(sample) if minimum is None else [minimum]
    minimum, sign = _measure(sample, limits, threshold)
    begins, ends = _edges(u, dt)
    parts = [Telegrams.none()]
    disturbances = 0
    for piece in pieces(u, dt):
        bursts = find_bursts(piece, minimum)
        first = piece.start + bursts.first * piece.step
        last = piece.start + bursts.last * piece.step
        own = (first >= piece.begin) & (first < piece.end)
        # What is cut off may be short.
        cut_front = _distance(first, begins, "right") < _NEAR
        cut_back = -_distance(last, ends, "left") < _NEAR
        whole = bursts.pulses >= np.where(cut_front | cut_back, 2, _FEWEST_PULSES)
        disturbances += int((own & ~whole).sum())
        kept = bursts.where(own & whole)
        edge = np.where(cut_front, 1, np.where(cut_back, 2, 0))[own & whole]
        parts.append(_receive(piece, kept, edge, sign, threshold))
    telegrams = Telegrams.joined(parts)
    table = transactions_of(telegrams, ends, extended)
    return Capture(table, len(u) * dt, sign < 0, minimum, disturbances)


def _checked(u: npt.ArrayLike, dt: float) -> Floats:
    array = np.asarray(u)
    if array.ndim != 1 or array.size == 0 or array.dtype.kind not in "iuf":
        raise ArgumentError(
            f"u has the shape {array.shape} and the type {array.dtype}; it must be one row of "
            "real voltages"
        )
    if not 0.1e-9 <= dt <= 1.001 * _LONGEST_STEP:
        raise ArgumentError(
            f"dt is {dt} s; it must be 1e-10..1e-6 s, three samples a half-bit or more"
        )
    # Extremes are found faster than a look at each sample would take, and tell as much.
    for extreme in (np.fmax.reduce(array), np.fmin.reduce(array)):
        if abs(float(extreme)) > _LARGEST:
            raise ArgumentError(f"u reaches {extreme} V; voltages must be within {_LARGEST:g} V")
    return array


def _liveliest(u: Floats, dt: float) -> npt.NDArray[np.intp]:
    """Choose up to 8 short pieces with much going on, to take the measure of the record."""
    length = round(_SAMPLE / dt)
    count = -(-len(u) // length)
    if count <= _SAMPLES:
        return np.arange(count)
    # A look at every 2 us or so finds the pieces with telegrams.
    stride = max(1, round(2e-6 / dt))
    whole = len(u) // length
    looks = u[: whole * length].reshape(whole, length)[:, ::stride]
    swing = np.nan_to_num(np.fmax.reduce(looks, axis=1) - np.fmin.reduce(looks, axis=1))
    lively = np.flatnonzero(swing >= np.quantile(swing, 0.75))
    return np.unique(lively[np.linspace(0, len(lively) - 1, _SAMPLES).astype(np.intp)])


def _edges(u: Floats, dt: float) -> tuple[Floats, Floats]:
    """Return when recording begins and when it ends, at the ends and around what is missing [s]."""
    nothing = np.isnan(u) if u.dtype.kind == "f" else np.zeros(0, dtype=bool)
    if not nothing.any():
        return np.zeros(1), np.array([len(u) * dt])
    change = np.diff(nothing.view(np.int8), prepend=0, append=0)
    since, until = np.flatnonzero(change > 0), np.flatnonzero(change < 0)
    # A few samples that are missing break nothing.
    long = (until - since) * dt > HALF_BIT
    return np.append(0, until[long]) * dt, np.append(since[long], len(u)) * dt


def _distance(
    times: npt.NDArray[np.floating], edges: Floats, side: Literal["left", "right"]
) -> npt.NDArray[np.floating]:
    """Return the time since the last edge ("right"), or since the next one, which is negative."""
    place = np.searchsorted(edges, times, side) - (side == "right")
    return times - edges[np.clip(place, 0, len(edges) - 1)]


def _measure(sample: list[Piece], limits: list[float], threshold: float) -> tuple[float, int]:
    """Return the limit and the polarity with which most telegrams of a sample are right."""
    best, most = (limits[0] if limits else 0.0, 1), -1.0
    for minimum in limits:
        right, heights, count = {1: 0, -1: 0}, 0, 0
        for piece in sample:
            bursts = find_bursts(piece, minimum)
            few = bursts.where(bursts.fits & (np.cumsum(bursts.fits) <= 64))
            edge = np.zeros(few.first.shape, dtype=np.int64)
            for sign in right:
                received = _receive(piece, few, edge, sign, threshold)
                right[sign] += int((received.error == 0).sum())
            count += int((bursts.pulses >= _FEWEST_PULSES).sum())
            heights += int(np.sign(bursts.height).sum())
        # The first pulse is negative: if no telegram is right, this is the next best evidence.
        sign = -1 if (right[-1], heights) > (right[1], 0) else 1
        if right[sign] > most:
            best, most = (minimum, sign), right[sign]
        if 2 * right[sign] > count:
            break
    return best


def _receive(
    piece: Piece, bursts: Bursts, edge: npt.NDArray[np.int64], sign: int, threshold: float
) -> Telegrams:
    """Decode the bursts of a piece, requests and responses each in one go."""
    parts = []
    before, behind = round(_BEFORE / piece.step), round(_BEHIND / piece.step)
    for n_bits in (REQUEST_BITS, RESPONSE_BITS):
        chosen = bursts.bits == n_bits
        begin = bursts.first[chosen] - before
        length = before + round(2 * n_bits * HALF_BIT / piece.step) + behind
        # Beyond the ends of the record nothing was heard.
        around = np.pad(piece.x, (before, length))
        # Measured in its own first pulse, a telegram needs no common limit for what is a pulse.
        unit = np.abs(bursts.height[chosen])
        rows = around[begin[:, np.newaxis] + before + np.arange(length)]
        rows *= (sign / unit).astype(np.float32)[:, np.newaxis]
        received = receive(
            rows, piece.step, n_bits, threshold=threshold, minimum=min(_FIRST_PULSE, threshold)
        )
        parts.append(
            Telegrams.of(
                received,
                piece.start + begin * piece.step,
                first=piece.start + bursts.first[chosen] * piece.step,
                last=piece.start + bursts.last[chosen] * piece.step,
                unit=unit,
                fits=bursts.fits[chosen],
                edge=edge[chosen],
            )
        )
    return Telegrams.joined(parts)
