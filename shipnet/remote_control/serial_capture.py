"""Recorded serial lines: bit rate, character format and characters, from levels or voltages.

Only the edges are used. The bit time is the slope of a straight line fitted to their times since
the start bit, over their bit numbers. The character format with the fewest faults is chosen.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

import numpy as np

from shipnet.arrays import Floats
from shipnet.errors import ArgumentError, InputError, name_of
from shipnet.fields import check_scalar
from shipnet.html import as_html
from shipnet.lazy import pd
from shipnet.line.scope_file import Edges, bit_time, read_edges
from shipnet.modbus.uart import SerialLine, Waveform, error_codes, read_characters

#: Data bits and parity that are tried.
_FORMS = tuple((data, parity) for data in (8, 7) for parity in "NEO")

#: Number of edges used to compare guesses, and the longest glitch [bit].
_HEAD, _GLITCH = 600, 1 / 3

#: Minimum number of samples per bit, and maximum number of edges in a record.
_FEWEST, _EDGES = 2.0, 2**22


def _fit(places: Floats, starts: Floats, bit: float, size: int) -> tuple[float, float]:
    """Return the bit time fitted to the edges within characters, and their rms deviation [bit]."""
    if not len(starts):
        return bit, 0.5
    character = np.searchsorted(starts, places, side="right") - 1
    since = places - starts[np.maximum(character, 0)]
    number = np.rint(since / bit)
    inside = (character >= 0) & (number >= 1) & (number < size + 2)
    near = inside & (np.abs(since - number * bit) < 0.3 * bit)
    if not near.any():
        return bit, 0.5
    fitted = float((since[near] * number[near]).sum() / (number[near] ** 2).sum())
    return fitted, float(np.sqrt(np.mean((since[inside] / fitted - number[inside]) ** 2)))


def _tuned(places: Floats, first: int, bit: float, size: int) -> float:
    """Return the bit time after a few rounds of reading and fitting."""
    begin = bit
    for _ in range(6):
        fitted, _ = _fit(places, read_characters(places, first, bit, size)[0], bit, size)
        if not 0.9 < fitted / begin < 1.1 or abs(fitted / bit - 1) < 1e-7:
            break
        bit = fitted
    return bit


def _without_glitches(places: Floats, bit: float) -> Floats:
    """Return the edges without pairs that are closer together than the longest glitch."""
    kept: list[float] = []
    for edge in places.tolist():
        if kept and edge - kept[-1] < _GLITCH * bit:
            kept.pop()
        else:
            kept.append(edge)
    return np.array(kept)


def _best(
    edges: Edges, first: int, bit: float | None, form: tuple[int, str] | None
) -> tuple[float, tuple[int, str]]:
    """Return the bit time and format with the fewest faults, preferring long bits and parity."""
    head = np.asarray(edges.places[:_HEAD], dtype=float)
    runs = np.diff(head)
    if bit:
        guesses = {bit}
    else:
        guesses = {float(np.quantile(runs, q)) / k for q in (0.1, 0.3, 0.5, 0.6) for k in (1, 2, 3)}
        guesses.add(bit_time(edges._replace(places=head), 9))
    best = (np.inf, bit or max(guesses), form or _FORMS[0])
    for guess in sorted(guess for guess in guesses if guess >= _FEWEST):
        clean = _without_glitches(head, guess)
        for data, parity in [form] if form else _FORMS:
            size = data + (0 if parity == "N" else 1)
            fitted = bit or _tuned(clean, first, guess, size)
            starts, bits, _ = read_characters(clean, first, fitted, size)
            if not len(starts):
                continue
            off = _fit(clean, starts, fitted, size)[1]
            score = (error_codes(bits, parity) > 0).mean()
            score += (len(head) - len(clean)) / len(head)
            score += 2 * max(0.0, off - 0.5 * edges.width / fitted - 0.02)
            # Prefer longer bits, because half the bit time also fits, and parity, because without
            # it only stop bits can be wrong.
            plain = 0.02 if parity == "N" else 0.0
            score += -0.5 * np.log2(fitted / runs.max()) + plain - 0.01 * data
            best = min(best, (score, fitted, (data, parity)))
    return best[1:]


@dataclass(frozen=True, eq=False, repr=False)
class SerialCapture:
    """Characters of a recorded serial line, as returned by `read_capture`.

    `bit_rate` is the given or detected rate at which the line was read, and `measured_rate` the
    sender's rate, computed from all edges [bit/s]. `character` gives the number of data bits, the
    parity and the number of stop bits, such as ``"8N1"``. `waveform` is the level including
    glitches, which `modbus.Waveform.decode` can read with other settings; None unless characters
    have 8 data bits. `duration` is the length of the record [s], and `channel` the channel of the
    file. `glitches` counts removed pulses shorter than a third of a bit, and false starts.

    Examples
    --------
    >>> from shipnet import datasets, remote_control
    >>> file = datasets.path("sigrok_uart_gps.sr")
    >>> remote_control.read_capture(file).data[30:38]
    b'$GPGSV,4'
    """

    bit_rate: float
    measured_rate: float
    character: str
    waveform: Waveform | None
    duration: float
    channel: str
    glitches: int
    _table: pd.DataFrame

    @property
    def data(self) -> bytes:
        """All characters, including wrong ones; only the low 8 bits of 9-bit characters."""
        return (self._table["value"].to_numpy(dtype=np.int64) & 255).astype(np.uint8).tobytes()

    def table(self) -> pd.DataFrame:
        """Return one row per character: ``start_s``, ``value``, ``error``.

        The error is ok, FormError (the stop bit is 0, a framing error) or ParityError.
        """
        return self._table.copy()

    def __repr__(self) -> str:
        errors = self._table["error"]
        counts = {
            "framing error": (errors == "FormError").sum(),
            "parity error": (errors == "ParityError").sum(),
            "glitch": self.glitches,
        }
        plural = {"glitch": "es"}
        parts = [
            f"{n} {what}{'' if n == 1 else plural.get(what, 's')}"
            for what, n in counts.items()
            if n
        ]
        read = f"{len(errors)} characters {self.character} at {self.bit_rate:.6g} bit/s"
        return f"SerialCapture({read}, {', '.join(parts) or 'no faults'})"

    def _repr_html_(self) -> str:
        right = self._table["error"] == "ok"
        rows = self._table.iloc[right.argsort(kind="stable")]
        return as_html(self, rows, ok=right.all() and not self.glitches)


def read_capture(
    path: str | PathLike[str],
    bit_rate: float | None = None,
    character: str | None = None,
    *,
    channel: str | None = None,
    sample_interval: float | None = None,
) -> SerialCapture:
    """Read the characters of a recorded serial line: logic levels, or sampled voltages.

    Parameters
    ----------
    path : path
        A file as for `shipnet.can.read_capture`. The idle level is read as 1.
    bit_rate : float, optional
        Bit rate of the receiver, 300..10e6 [bit/s]; by default the detected rate of the sender.
    character : str, optional
        Data bits (5..9), parity (N, E, O) and stop bits (1, 2), such as ``"8N1"``; by default
        detected, with 7 or 8 data bits.
    channel : str, optional
        Title or number of the channel; by default the channel with the most edges.
    sample_interval : float, optional
        Time between two samples [s]; it overrides the value in the file.

    Returns
    -------
    SerialCapture
        Every character that begins in the record.

    Raises
    ------
    InputError
        If the file cannot be read, or has no time information, fewer than 2 samples per bit, more
        than 2**22 edges or, if `bit_rate` is not given, too few edges to determine it.

    Notes
    -----
    A start bit begins where the level falls, and counts if the line is still 0 half a bit later.
    Each bit is sampled in its middle, and the next character begins at the first falling edge
    after the middle of the first stop bit. Pulses shorter than a third of a bit are removed first.

    The bit rate and character format with the fewest faults are chosen. With fewer than about ten
    characters, several formats may fit, and the result is a guess; pass `bit_rate` and `character`.

    Examples
    --------
    >>> from shipnet import datasets
    >>> read_capture(datasets.path("sigrok_uart_gps.sr"))
    SerialCapture(1351 characters 8N1 at 9605.41 bit/s, no faults)
    """
    file = Path(path)
    rate = None if bit_rate is None else check_scalar("bit_rate", bit_rate, "bit/s", 300, 10e6)
    form = None
    if character is not None:
        if not isinstance(character, str) or not re.fullmatch("[5-9][NEO][12]", character):
            raise ArgumentError(f"character is {character!r}; write 5..9, N/E/O and 1/2, as in 8N1")
        form = int(character[0]), character[1]
    edges = read_edges(file, channel=channel, sample_interval=sample_interval)
    if len(edges.places) > _EDGES:
        raise InputError(str(file), f"more than {_EDGES} changes of level; save a shorter record")
    bit = None if rate is None else 1 / (rate * edges.dt)
    if bit is not None and bit < _FEWEST:
        raise InputError(
            str(file), f"it has {bit:.2g} samples per bit at {rate:g} bit/s; 2 are needed"
        )
    if len(edges.places) < 4 and bit is None:
        raise InputError(str(file), "too few changes of level to find the bit rate; pass bit_rate")
    # Only an idle line stays unchanged for longer than a character.
    runs = np.diff(edges.places, prepend=0, append=edges.samples)
    level = (np.arange(len(runs)) + edges.first) & 1
    long = level[runs > 13 * (bit or bit_time(edges, 9))]
    rests = int(2 * np.count_nonzero(long) >= len(long))
    first = edges.first if rests else edges.first ^ 1
    places = np.asarray(edges.places, dtype=float)
    if len(places) >= 2:
        bit, form = _best(edges, first, bit, form)
    data, parity = form or _FORMS[0]
    if bit is None or bit < _FEWEST:
        raise InputError(str(file), "fewer than 2 samples per bit")
    size = data + (0 if parity == "N" else 1)
    # The sender's clock is independent of the receiver's clock.
    sent = _best(edges, first, None, (data, parity))[0] if len(places) >= 4 else bit
    sent = _tuned(_without_glitches(places, sent), first, sent, size)
    bit = bit if rate else sent
    clean = _without_glitches(places, bit)
    starts, bits, false_starts = read_characters(clean, first, bit, size)
    idle = np.diff(starts) / bit - (size + 1)
    stops = 2 if len(idle) > 4 and np.quantile(idle, 0.05) > 1.75 else 1
    character = character or f"{data}{parity}{stops}"
    rate = rate or 1 / (bit * edges.dt)
    waveform = None
    if data == 8:
        times = np.concatenate([[0.0], places]) * edges.dt
        levels = ((np.arange(len(times)) + first) & 1).astype(np.float64)
        waveform = Waveform(times, levels, SerialLine(rate, character))
    columns = {
        "start_s": starts * edges.dt,
        "value": bits[:, 1 : data + 1] @ (1 << np.arange(data)),
        "error": [name_of(code) for code in error_codes(bits, parity).tolist()],
    }
    return SerialCapture(
        rate,
        1 / (sent * edges.dt),
        character,
        waveform,
        edges.samples * edges.dt,
        edges.channel,
        (len(places) - len(clean)) // 2 + false_starts,
        pd.DataFrame(columns),
    )
