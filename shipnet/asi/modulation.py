"""Alternating pulse modulation: bits -> Manchester levels -> send current -> pulses, and back.

A bit lasts two half-bits of 3 us. In Manchester code, the level falls in the middle of a 0 and
rises in the middle of a 1. The sender draws more current at the low level. The supply's inductors
turn each rise of the current into a negative voltage pulse and each fall into a positive one. A
telegram of n bits has 2 n *slots*, one per half-bit, and is followed by two empty slots. Pulses of
alternating sign fill each odd slot (the middle of a bit) and each even slot between two equal bits.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import numpy.typing as npt

from shipnet import style
from shipnet.arrays import Bools, Complexes, Floats
from shipnet.asi.batch import NONE
from shipnet.asi.telegram import REQUEST_BITS, RESPONSE_BITS, RESPONSES
from shipnet.asi.timing import BIT_TIME
from shipnet.compiled import compiled
from shipnet.errors import (
    AlternationError,
    ArgumentError,
    EndBitError,
    FrameError,
    InformationError,
    LengthError,
    ParityError,
    PauseError,
    StartBitError,
)
from shipnet.fields import check_scalar
from shipnet.lazy import Axes

if TYPE_CHECKING:
    from shipnet.line.waveform import Waveform

#: Duration of a half-bit [s].
HALF_BIT = BIT_TIME / 2

#: Assumed peak-to-peak send current [A]; ASI4U data sheets state 55 to 68 mA.
SEND_CURRENT = 60e-3

Codes = npt.NDArray[np.uint8]
Signs = npt.NDArray[np.int8]


def pulse(x: npt.ArrayLike) -> Floats:
    r"""Return a pulse of height 1 at times `x` in half-bits: the slope of `ramp`, halved.

    .. math:: p(x) = \sin^2 \pi x, \qquad 0 \le x \le 1
    """
    return np.sin(np.pi * np.clip(x, 0.0, 1.0)) ** 2


def ramp(x: npt.ArrayLike) -> Floats:
    r"""Return a current step from 0 to 1 at times `x` in half-bits: the integral of a sin^2 pulse.

    .. math:: \rho(x) = x - \frac{\sin 2 \pi x}{2 \pi}
    """
    x = np.clip(x, 0.0, 1.0)
    return x - np.sin(2 * np.pi * x) / (2 * np.pi)


def ramp_spectrum(s: npt.ArrayLike, *, half_bit: float = HALF_BIT) -> Complexes:
    r"""Return the Laplace transform, at `s` [rad/s], of the slope of a current step from 0 to 1.

    .. math:: P(s) = e^{-x} \, \frac{\sinh x}{x} \, \frac{1}{1 + (x / \pi)^2},
              \qquad x = \frac{s T_h}{2}
    """
    x = np.asarray(s, dtype=complex) * half_bit / 2
    small = np.abs(x) < 1e-6
    pole = np.abs(1 + (x / np.pi) ** 2) < 1e-9
    safe = np.where(small | pole, 1.0, x)
    # e^-x sinh x, written so that it does not overflow for a large real part.
    value = -np.expm1(-2 * safe) / (2 * safe) / (1 + (safe / np.pi) ** 2)
    return np.where(small, np.exp(-x), np.where(pole, 0.5 * np.exp(-x), value))


#: Error classes of kim2023, section 3.4, by name of the rule, in the order of the checks.
CLASSES: dict[str, type[FrameError]] = {
    "start": StartBitError,
    "alternation": AlternationError,
    "pause": PauseError,
    "information": InformationError,
    "parity": ParityError,
    "end": EndBitError,
    "length": LengthError,
}


@compiled
def violated(pulse: Signs | list[int]) -> tuple[int, int, int, int, int, int, int]:
    """Return the slot that first violates each rule of a telegram, or -1 (kim2023, section 3.4).

    The rules are in the order of `CLASSES`; `pulse` ends with the two slots of silence.
    """
    last = len(pulse) - 3
    start = alternation = pause = information = parity = end = length = -1
    if pulse[0] != 0:
        start = 0
    elif pulse[1] != -1:  # the start bit is a 0
        start = 1
    before, ones = 0, 0
    for k in range(1, last + 1):
        if pulse[k] != 0:
            if pulse[k] == before and alternation < 0:
                alternation = k
            before = pulse[k]
        if pulse[k] == 0 and k < last and pulse[k + 1] == 0 and pause < 0:
            pause = k
        if pulse[k] == 0 and k % 2 == 1 and information < 0:  # the middle of a bit
            information = k
        if pulse[k] > 0 and k % 2 == 1 and 1 < k < last:
            ones += 1
    if ones % 2 == 1:
        parity = last - 2
    if pulse[last] != 1:  # the end bit is a 1
        end = last
    if pulse[last + 1] != 0:
        length = last + 1
    elif pulse[last + 2] != 0:
        length = last + 2
    return start, alternation, pause, information, parity, end, length


@compiled
def violated_by_rows(pulses: Signs) -> Signs:
    """Return the slot that first violates each rule, one row per telegram."""
    slots = np.zeros((len(pulses), 7), np.int8)
    for row in range(len(pulses)):
        slots[row] = violated(pulses[row])
    return slots


def decided(pulses: Signs, places: Signs) -> tuple[Signs, Codes]:
    """Return the bits of telegrams and the error code of the first violated rule, or 0."""
    failed, middles = places >= 0, pulses[..., 1:-2:2]
    codes = np.array([kind.code for kind in CLASSES.values()], np.uint8)
    error = np.where(failed.any(axis=-1), codes[failed.argmax(axis=-1)], 0).astype(np.uint8)
    return np.where(middles == 0, NONE, middles > 0).astype(np.int8), error


@dataclass(frozen=True, eq=False, repr=False)
class Modulation:
    r"""Alternating pulse modulation of bits: levels, send current, its spectrum, and pulses.

    .. math:: i(t) = I_0 \sum_j d_j \, \rho\left(\frac{t}{T_h} - j\right), \qquad
              \rho(x) = x - \frac{\sin 2 \pi x}{2 \pi}

    Parameters
    ----------
    bits : str, sequence of str, or array_like of int, shape (..., n)
        Bits, 0 or 1, of one telegram or of several telegrams of equal length.

    References
    ----------
    .. [1] ZMD AG, "ASI4U Universal AS-Interface IC", data sheet rev. 1.4, 2006, p. 21.

    Examples
    --------
    >>> code = Modulation("0011001")
    >>> code.pulses
    0-+-0+-+0-+-0+
    >>> code.current([0, 4.5e-6, 6e-6, 9e-6]).round(3).tolist()
    [0.0, 0.03, 0.06, 0.0]
    """

    bits: Signs

    def __init__(self, bits: str | Sequence[str] | npt.ArrayLike) -> None:
        try:
            array = np.asarray(bits)
        except ValueError:
            raise ArgumentError("bits must be telegrams of equal length") from None
        if array.dtype.kind == "U" and array.size:
            lengths = np.char.str_len(array)
            least, most = lengths.min(), lengths.max()
            if least != most:
                raise ArgumentError(
                    f"bits must be telegrams of equal length, not {least} to {most} bits"
                )
            array = np.ascontiguousarray(array).view("U1").reshape(*array.shape, -1)
            array = np.where(np.isin(array, ("0", "1")), array == "1", 2)
        if array.ndim == 0 or array.shape[-1] == 0:
            raise ArgumentError("bits must have at least one bit")
        if not np.isin(array, (0, 1)).all():
            raise ArgumentError(f"bits of telegrams must be 0 or 1, but are {bits!r}")
        object.__setattr__(self, "bits", array.astype(np.int8))

    def __repr__(self) -> str:
        if self.bits.ndim > 1:
            return f"<Modulation: {' x '.join(map(str, self.bits.shape))} bits>"
        return f"Modulation('{self.text}')"

    @property
    def text(self) -> str:
        """Bits of one telegram as a string of ``0`` and ``1``."""
        return "".join(map(str, self.bits.ravel().tolist()))

    @property
    def levels(self) -> Signs:
        """Manchester level of each half-bit, 1 for high; a 0 bit is high, then low."""
        return np.stack([1 - self.bits, self.bits], axis=-1).reshape(*self.bits.shape[:-1], -1)

    @property
    def steps(self) -> Signs:
        """Change of the send current in each half-bit: +1 if it rises, -1 if it falls, else 0."""
        drawn = 1 - self.levels
        return np.diff(drawn, axis=-1, prepend=np.zeros_like(drawn[..., :1]))

    @property
    def pulses(self) -> Pulses:
        """Sign of the voltage pulse in each half-bit; 0 if there is no pulse."""
        return Pulses(-self.steps)

    def current(self, t: npt.ArrayLike, *, start: float = 0.0) -> Floats:
        """Return the send current [A] at times `t` [s] of a telegram that begins at `start` [s]."""
        begin = check_scalar("start", start, "s", -1e9, 1e9)
        since, steps = (np.asarray(t, dtype=float) - begin) / HALF_BIT, self.steps
        return SEND_CURRENT * (steps @ ramp(since - np.arange(steps.shape[-1])[:, np.newaxis]))

    def transform(self, s: npt.ArrayLike, *, start: float = 0.0) -> Complexes:
        r"""Return the Laplace transform of the send current [A s] at nonzero `s` [rad/s].

        .. math:: I(s) = \frac{I_0}{s} P(s) \sum_j d_j \, e^{-s (t_0 + j T_h)}
        """
        s, steps = np.asarray(s, dtype=complex), self.steps
        if np.any(s == 0):
            raise ArgumentError("s contains 0, for which the formula is undefined")
        at = check_scalar("start", start, "s", -1e9, 1e9) + HALF_BIT * np.arange(steps.shape[-1])
        return np.asarray(SEND_CURRENT * ramp_spectrum(s) / s * (steps @ np.exp(-np.outer(at, s))))

    def spectrum(self, f: npt.ArrayLike) -> Floats:
        """Return the magnitude spectrum [A] of the current's slope at frequencies `f` above 0 [Hz].

        The telegram's voltage is proportional to this slope.
        """
        s = 2j * np.pi * np.asarray(f, dtype=float)
        return np.abs(s * self.transform(s))

    @staticmethod
    def pulse_spectrum(f: npt.ArrayLike) -> Floats:
        """Return the magnitude spectrum of a pulse at frequencies `f` [Hz], relative to 0 Hz."""
        return np.abs(ramp_spectrum(2j * np.pi * np.asarray(f, dtype=float)))

    def plot(self, wave: Waveform, axes: Sequence[Axes] | None = None) -> Sequence[Axes]:
        """Draw one telegram and `wave`, its voltage on the line, and return the axes.

        Three axes show levels, current and voltage, as in icn2007's Figs 7a and 7b. Six axes, the
        default, show every stage from bits to pulses and back to bits, as in kim2023's Table 3.
        """
        u, n_axes = wave.u.reshape(-1, wave.u.shape[-1]), 6 if axes is None else len(axes)
        if n_axes not in (3, 6) or len(u) != 1:
            raise ArgumentError(
                f"{n_axes} axes and {len(u)} voltages given; give 3 or 6 axes and 1 voltage"
            )
        if axes is None:
            from shipnet.figure import house

            with house():
                six = style.axes(nrows=6, figsize=(6.4, 8), sharex=True)
                return self.plot(wave, cast("Sequence[Axes]", six))
        bits, t = self.text, wave.t
        edges = np.arange(2 * len(bits) + 1) * HALF_BIT * 1e6
        signals = [(1e3 * self.current(t), "C1", "current [mA]"), (u[0], "C2", "voltage [V]")]
        middle = axes[1:] if len(axes) == 3 else axes[2:4]
        for ax, (values, colour, label) in zip(middle, signals, strict=True):
            ax.plot(t * 1e6, values, color=colour)
            ax.set(ylabel=label)
        axes[-1].set_xlabel("time [µs]")
        if len(axes) == 3:
            axes[0].step(edges, [*self.levels, 1], where="post")
            _write_bits(axes[0], bits, 1.25, va="baseline")
            axes[0].set(ylabel="level", ylim=(-0.2, 1.7))
            return axes
        pulses = self.pulses
        for ax, row, what in [
            (axes[0], bits, "1 bits to send"),
            (axes[5], pulses.decode(), "6 bits received"),
        ]:
            ax.step(edges[::2], [int(bit) for bit in row + row[-1]], where="post", color="C0")
            _write_bits(ax, row, 0.5)
            ax.set(ylabel="level", yticks=[0, 1], ylim=(-0.2, 1.2), title=what)
        axes[1].step(edges, [*self.levels, self.levels[-1]], where="post", color="C0")
        axes[1].set(ylabel="level", yticks=[0, 1], ylim=(-0.2, 1.2), title="2 Manchester code")
        axes[2].set_title("3 send current")
        axes[3].set_title("4 voltage on the line")
        slots = np.flatnonzero(pulses)
        axes[4].stem((slots + 0.5) * HALF_BIT * 1e6, pulses.signs[slots], basefmt="0.7")
        axes[4].set(ylabel="pulse", ylim=(-1.4, 1.4), title="5 pulses at the receiver")
        return axes


#: Descriptions of pulse signs in error messages.
_SIGN = {-1: "-", 0: "no pulse", 1: "+"}


def _violation(rule: str, at: int, pulse: Sequence[int]) -> str:
    """Describe the violation of a rule at a slot."""
    slot = f"slot {at} has {_SIGN[pulse[at]]}"
    if rule == "start":
        must = "the start bit's pulse must be -" if at else "the first pulse belongs in slot 1"
        return f"{slot}; {must}"
    if rule == "alternation":
        before = max(k for k in range(at) if pulse[k])
        return f"{slot} like slot {before}, the previous pulse; signs must alternate"
    if rule == "pause":
        return f"slots {at} and {at + 1} are both empty inside the telegram"
    if rule == "information":
        return f"slot {at}, the middle of bit {at // 2}, is empty"
    if rule == "parity":
        bits = "".join("1" if sign > 0 else "0" for sign in pulse[1 : at + 1 : 2])
        count = bits.count("1")
        return f"slots 1 to {at} contain {bits}, with {count} ones; the number must be even"
    if rule == "end":
        return f"{slot}; the end bit's pulse must be +"
    return f"{slot}; the line must be silent after slot {len(pulse) - 3}"


def _write_bits(ax: Axes, bits: str, height: float, va: str = "center") -> None:
    """Write each bit in the middle of its bit time."""
    for index, bit in enumerate(bits):
        middle = (2 * index + 1) * HALF_BIT * 1e6
        ax.text(middle, height, bit, ha="center", va=va, family="monospace")


@dataclass(frozen=True, eq=False, repr=False)
class Pulses:
    """Signs of the pulses in telegrams, one per half-bit from the start of each telegram.

    Parameters
    ----------
    signs : str or array_like of int, shape (..., n)
        Signs -1, 0 (no pulse) and +1, or a string of ``-``, ``0`` and ``+``. A telegram of n bits
        has 2 n signs; two more may follow for the half-bits of silence after the telegram.

    References
    ----------
    .. [1] ZMD AG, "SAP5S/SAP51 Universal AS-Interface IC", data sheet rev. 3.1, 2012, p. 45.

    Examples
    --------
    A lost pulse often violates several rules:

    >>> Pulses("0-+-0+-+0-+-0+").decode()
    '0011001'
    >>> Pulses("0-+-0+-00-+-0+00").broken
    ('alternation', 'pause', 'information', 'parity')

    Two slaves respond at once, with 6 and 5; pulses of opposite sign cancel:

    >>> Modulation("0011001").pulses + Modulation("0010101").pulses
    0-+-0+-000+-0+
    """

    signs: Signs

    def __init__(self, signs: str | npt.ArrayLike) -> None:
        if isinstance(signs, str):
            if set(signs) - set("-0+") or not signs:
                raise ArgumentError(f"signs are {signs!r}; they must be -, 0 or +")
            signs = ["-0+".index(sign) - 1 for sign in signs]
        array = np.asarray(signs)
        whole = array.ndim and array.dtype.kind in "iu"
        if not whole or (array.size and not -1 <= array.min() <= array.max() <= 1):
            raise ArgumentError(f"signs are {signs!r}; they must be -1, 0 or +1")
        object.__setattr__(self, "signs", array.astype(np.int8, copy=False))

    def __repr__(self) -> str:
        if self.signs.ndim > 1:
            return f"<Pulses: {' x '.join(map(str, self.signs.shape))} half-bits>"
        return "".join("0+-"[sign] for sign in self.signs)

    def __array__(
        self, dtype: npt.DTypeLike | None = None, copy: bool | None = None
    ) -> npt.NDArray[Any]:
        """Return the signs, so that NumPy functions accept `Pulses` objects."""
        return np.array(self.signs, dtype=dtype, copy=bool(copy) or None)

    @property
    def count(self) -> int:
        """Number of half-bits with a pulse."""
        return int(np.count_nonzero(self.signs))

    @property
    def _telegrams(self) -> Signs:
        """Signs with two half-bits of silence."""
        signs, lengths = self.signs, (2 * RESPONSE_BITS, 2 * REQUEST_BITS)
        if signs.shape[-1] in lengths:
            signs = np.pad(signs, [(0, 0)] * (signs.ndim - 1) + [(0, 2)])
        if signs.shape[-1] - 2 not in lengths:
            raise ArgumentError(
                f"there are {signs.shape[-1]} half-bits; a response has {lengths[0]} and a request "
                f"{lengths[1]}, plus two if the silence after it is included"
            )
        return np.ascontiguousarray(signs)

    @property
    def _telegram(self) -> list[int]:
        """Signs of one telegram with two half-bits of silence."""
        if self.signs.ndim != 1:
            raise ArgumentError(f"pulses have shape {self.signs.shape}; give one telegram")
        telegram: list[int] = self._telegrams.tolist()
        return telegram

    @property
    def _places(self) -> Signs:
        """Slot that first violates each rule, or -1; the last axis has the order of `CLASSES`."""
        pulses = self._telegrams
        rows = pulses.reshape(-1, pulses.shape[-1])
        slots = violated_by_rows.run(rows.size, rows)
        return slots.reshape(*pulses.shape[:-1], len(CLASSES))

    @property
    def violations(self) -> Bools:
        """True for each check that a telegram fails; the last axis has the order of `CLASSES`."""
        return np.asarray(self._places >= 0)

    def check(self) -> tuple[Signs, Codes]:
        """Return the bits of each telegram, -1 where a pulse is missing, and its error code."""
        return decided(self._telegrams, self._places)

    def decode(self) -> str:
        """Return the bits of one telegram, or raise the FrameError of the first violated rule."""
        pulse = self._telegram
        for (rule, kind), slot in zip(CLASSES.items(), violated(pulse), strict=True):
            if slot >= 0:
                raise kind(_violation(rule, slot, pulse))
        return "".join("1" if sign > 0 else "0" for sign in pulse[1:-2:2])

    @property
    def broken(self) -> tuple[str, ...]:
        """Names of the rules that one telegram violates, in the order of the checks."""
        slots = violated(self._telegram)
        return tuple(rule for rule, slot in zip(CLASSES, slots, strict=True) if slot >= 0)

    @property
    def error(self) -> str:
        """Class name of one telegram's first error, such as ``"ParityError"``; ``"ok"`` if none."""
        broken = self.broken
        return CLASSES[broken[0]].__name__ if broken else "ok"

    def __add__(self, other: Pulses) -> Pulses:
        """Return the pulses of two simultaneous telegrams; pulses of opposite sign cancel."""
        if not isinstance(other, Pulses) or other.signs.shape != self.signs.shape:
            return NotImplemented
        return Pulses(np.sign(self.signs + other.signs))

    @style.applied
    def plot(self, ax: Axes | None = None, *, faults: Sequence[int] = ()) -> Axes:
        """Draw the pulses of one telegram, with the slots listed in `faults` in red."""
        ax = style.axes(ax)
        for slot, sign in enumerate(self.signs):
            colour = style.LIMIT["color"] if slot in faults else "C0"
            x = np.linspace(0, 1, 30)
            ax.plot(slot + x, sign * pulse(x), color=colour)
            if slot in faults:
                ax.axvspan(slot, slot + 1, color=colour, alpha=0.15, linewidth=0)
        ax.set(xlim=(0, self.signs.size), ylim=(-1.3, 1.3), yticks=[-1, 0, 1])
        ax.set(xlabel="slot [half-bit]", ylabel="pulse")
        return ax


@lru_cache(maxsize=4096)
def collide(telegrams: tuple[tuple[str, int], ...], n_bits: int) -> tuple[str, int]:
    """Return bits and error code received from overlapping telegrams, each (bits, first slot)."""
    total = np.zeros(2 * n_bits + 2, dtype=np.int64)
    for telegram, start in telegrams:
        pulses = Modulation(telegram).pulses.signs
        slots = start + np.arange(pulses.size)
        inside = (slots >= 0) & (slots < total.size)
        total[slots[inside]] += pulses[inside]
    bits, error = Pulses(np.sign(total)).check()
    return ("", int(error)) if error else ("".join(map(str, bits)), 0)


def _one_pulse_codes() -> list[list[int]]:
    table = []
    for word in np.pad(Modulation(RESPONSES).pulses.signs, ((0, 0), (0, 2))):
        hit = np.eye(word.size, dtype=bool)[:, np.newaxis]
        all_values = np.where(hit, np.array([[-1], [0], [1]]), word)
        wrong = all_values[(all_values != word).any(axis=-1)]
        table.append(Pulses(wrong).check()[1].tolist())
    return table


#: Error codes of each response 0..15 with one disturbed slot: a pulse is lost, inverted or added
#: in one of the 16 slots (14 and two of silence). None of a response's 32 codes is 0.
ONE_PULSE_CODES = _one_pulse_codes()
