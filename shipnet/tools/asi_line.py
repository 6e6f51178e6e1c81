"""The line explorer: a slave answers over a cable, and the master says what it makes of it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes

from shipnet import style
from shipnet.asi.modulation import HALF_BIT, bits_of_slots
from shipnet.asi.receiver import (
    MINIMUM,
    TOLERANCE,
    Reception,
    matched_filter,
    receive,
)
from shipnet.asi.telegram import Response
from shipnet.asi.topologies import line
from shipnet.errors import FrameError, SilenceError
from shipnet.fields import choice, number, record, switch, whole
from shipnet.line.cable import CABLES, Cable
from shipnet.tools._tool import Tool
from shipnet.tools._view import View

#: Cables to choose from. The corners combine the limits of a data sheet, 0.5 to 0.75 uH/m and at
#: most 80 pF/m (Lapp, UNITRONIC BUS ASI); their resistance is that of the nominal cable.
CABLE_CHOICES = MappingProxyType(
    {
        "nominal: 100 ohm, 6.5 ns/m": CABLES["as-i 1.5"],
        "lossless: 100 ohm, 6.5 ns/m": CABLES["as-i lossless"],
        "low: 79 ohm, 6.3 ns/m": Cable(r=0.06, l=0.5e-6, c=80e-12),
        "slow: 97 ohm, 7.7 ns/m": Cable(r=0.06, l=0.75e-6, c=80e-12),
    }
)

#: Sampling interval, begin of the answer in the record, and silence after it [s].
STEP, START, SILENCE = 250e-9, 6e-6, 28.8e-6

#: Standard deviation of white noise behind the matched filter over that before it: the root of
#: 8/3 of the sampling interval in half-bits.
FILTERED = (8 / 3 * STEP / HALF_BIT) ** 0.5

Floats = npt.NDArray[np.floating]


@record
class AsiLine(Tool):
    """A slave that answers over a cable, and what the master reads.

    `result` has the voltage at the master, the bits sent and read, and the error.

    Raises
    ------
    ArgumentError
        If a value is out of its range.

    Examples
    --------
    >>> AsiLine().verdict
    'read 0011001: response: 0110 (6)'
    >>> AsiLine(length=200).verdict
    'InformationError: slot 3 is empty; it is the middle of bit 1'
    """

    length: float = number(
        1, 500, default=100.0, unit="m", slider=(10, 300), step=5, label="length",
        help="Length of the cable. The standard allows 100 m without a repeater.",
    )  # fmt: skip
    place: float = number(
        0, 500, default=5.0, unit="m", slider=(0, 300), step=5, label="slave at",
        help="Distance of the slave from master and supply; beyond the end means at the end.",
    )  # fmt: skip
    cable: str = choice(
        list(CABLE_CHOICES), default=next(iter(CABLE_CHOICES)), label="cable",
        help="Impedance and delay: the nominal cable, and the corners of a data sheet's limits.",
    )  # fmt: skip
    terminator: bool = switch(
        default=False,
        label="100 ohm at the end",
        help="A resistor at the far end takes up the echo.",
    )
    noise: float = number(
        0, 10, default=0.0, unit="V", slider=(0, 1.5), step=0.05, label="noise",
        help="Standard deviation of white noise at the master, sampled at 4 MS/s.",
    )  # fmt: skip
    data: int = whole(0, 15, default=6, label="data", help="The four bits that the slave answers.")
    seed: int = whole(
        0, 999, default=0, slider=(0, 99), label="try", help="Another try draws other noise."
    )

    @cached_property
    def result(self) -> Result:
        """Send an answer over the line and receive it."""
        sent = Response(self.data).bits
        plan = line(
            self.length,
            slaves=(min(self.place, self.length),),
            cable=CABLE_CHOICES[self.cable],
            terminator=100.0 if self.terminator else None,
        )
        wave = plan.waveform(sent, plan.slaves[0].node, dt=STEP, before=START, after=SILENCE)
        u = wave.u + np.random.default_rng(self.seed).normal(0, self.noise, wave.u.size)
        # Four standard deviations keep the noise before the answer from looking like a pulse.
        minimum = max(MINIMUM, 4 * FILTERED * self.noise)
        found = receive(u, STEP, len(sent), minimum=minimum)
        return Result(wave.t, u, matched_filter(u, STEP), sent, found, _error_of(found))

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the voltage with what the receiver sees in it."""
        result, ax = self.result, style.axes(ax)
        found = result.reception
        ax.plot(result.t * 1e6, result.u, color="0.6", linewidth=1, label="on the line")
        ax.plot(result.t * 1e6, result.filtered, color="C0", label="behind the filter")
        if np.isfinite(found.start):
            middles = found.start - START + HALF_BIT * (np.arange(found.slots.size) + 0.5)
            heights = np.interp(middles, result.t, result.filtered)
            filled = found.slots != 0
            ax.plot(middles[filled] * 1e6, heights[filled], "o", color="C1", label="pulse")
            ax.plot(middles[~filled][1:] * 1e6, heights[~filled][1:], "x", color="C1", label="none")
            threshold = abs(heights[1]) / 2
            for level in (threshold, -threshold):
                ax.axhline(level, color=style.LIMIT["color"], linestyle=style.LIMIT["linestyle"])
            ax.text(62, threshold, "threshold", color=style.LIMIT["color"], ha="right", va="bottom")
        ax.set(xlim=(-5, 63), xlabel="time [us]", ylabel="voltage at the master [V]")
        ax.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=4)
        return ax

    def _view(self) -> View:
        """Return what the page shows."""
        result = self.result
        return View(
            verdict=result.verdict,
            ok=result.read == result.sent,
            numbers=result.numbers,
            plot=self.plot,
            about="Voltage at the master over time, and the pulses that the receiver finds",
        )


@dataclass(frozen=True, eq=False, slots=True)
class Result:
    """What the master makes of the answer."""

    t: Floats
    u: Floats
    filtered: Floats
    sent: str
    reception: Reception
    error: FrameError | None

    @property
    def read(self) -> str:
        """The bits that the master read; empty after an error."""
        if self.error is not None:
            return ""
        return "".join(map(str, self.reception.bits.tolist()))

    @property
    def verdict(self) -> str:
        """One line: what was read, or what is wrong."""
        if self.error is not None:
            return f"{type(self.error).__name__}: {self.error}"
        if self.read != self.sent:
            return f"read {self.read}, but {self.sent} was sent: the fault went undetected"
        return f"read {self.read}: {Response.parse(self.read)}"

    @property
    def numbers(self) -> dict[str, str]:
        """Size of the signal, and how even and how still it is, as text with units."""
        found = self.reception
        texts = {"signal": f"{np.ptp(self.u):.1f} Vpp"}
        if np.isfinite(found.amplitude):
            texts["first pulse"] = f"{found.amplitude:.2f} V"
            texts["weakest pulse"] = (
                f"{found.weakest:.0%} of the largest, {TOLERANCE.evenness:.0%} needed"
            )
            texts["ringing"] = (
                f"{found.ringing:.0%} of the largest, {TOLERANCE.ringing:.0%} allowed"
            )
        return texts


def _error_of(found: Reception) -> FrameError | None:
    if found.error == SilenceError.code:
        return SilenceError("the line holds no pulse that stands out of the noise")
    try:
        bits_of_slots(found.slots)
    except FrameError as error:
        return error
    return None
