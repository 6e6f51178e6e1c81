"""The line explorer: a slave responds over a cable, and the master decodes the response."""

from __future__ import annotations

from functools import cached_property
from types import MappingProxyType

import numpy as np
from matplotlib.axes import Axes

from shipnet.asi.emc.disturbances import Noise
from shipnet.asi.modulation import HALF_BIT
from shipnet.asi.receiver import MINIMUM, TOLERANCE, Receiver, Reception, Waveform
from shipnet.asi.telegram import Response
from shipnet.asi.topologies import line
from shipnet.errors import FrameError, SilenceError
from shipnet.fields import choice, number, record, switch, whole
from shipnet.line.cable import Cable
from shipnet.tools._tool import Tool
from shipnet.tools._view import View

#: Cables to choose from. The extremes combine limits from a data sheet (Lapp, UNITRONIC BUS ASI:
#: 0.5 to 0.75 uH/m, at most 80 pF/m) with the resistance of the nominal cable.
CABLE_CHOICES = MappingProxyType[str, str | Cable](
    {
        "nominal: 100 ohm, 6.5 ns/m": "as-i 1.5",
        "lossless: 100 ohm, 6.5 ns/m": "as-i lossless",
        "low: 79 ohm, 6.3 ns/m": Cable(r=0.06, l=0.5e-6, c=80e-12),
        "slow: 97 ohm, 7.7 ns/m": Cable(r=0.06, l=0.75e-6, c=80e-12),
    }
)

#: Sampling interval, and times recorded before and after the response [s].
STEP, BEFORE, AFTER = 250e-9, 6e-6, 28.8e-6

#: Ratio of the standard deviations of white noise after and before the matched filter:
#: sqrt(8 d / 3), where d is the sampling interval in half-bits.
FILTERED = (8 / 3 * STEP / HALF_BIT) ** 0.5


@record
class AsiLine(Tool):
    """A slave that responds over a cable, and the response as the master reads it.

    `wave` is the voltage at the master, an `asi.Waveform`, and `result` is the decoded reception,
    an `asi.Reception`.

    Examples
    --------
    >>> AsiLine().verdict
    'read 0011001: response: 0110 (6)'
    >>> AsiLine(length=200).verdict
    'InformationError: slot 3, the middle of bit 1, is empty'
    """

    length: float = number(
        1,
        500,
        default=100.0,
        unit="m",
        slider=(10, 300),
        step=5,
        label="length",
        help="Length of the cable. The standard allows 100 m without a repeater.",
    )
    place: float = number(
        0,
        500,
        default=5.0,
        unit="m",
        slider=(0, 300),
        step=5,
        label="slave at",
        help="Distance of the slave from master and supply, limited to the length of the cable.",
    )
    cable: str = choice(
        list(CABLE_CHOICES),
        default=next(iter(CABLE_CHOICES)),
        label="cable",
        help="Characteristic impedance and delay: nominal, or extremes of a data sheet.",
    )
    terminator: bool = switch(
        default=False,
        label="100 ohm at the end",
        help="A terminator absorbs the echo but loads the line.",
    )
    noise: float = number(
        0,
        10,
        default=0.0,
        unit="V",
        slider=(0, 1.5),
        step=0.05,
        label="noise in 2 MHz",
        help="Standard deviation of white noise at the master, in a bandwidth of 2 MHz: "
        "1 V is 0.71 mV per root hertz.",
    )
    data: int = whole(0, 15, default=6, label="data", help="The four bits of the response.")
    seed: int = whole(
        0, 999, default=0, slider=(0, 99), label="try", help="Each try has different noise."
    )

    @property
    def receiver(self) -> Receiver:
        """The receiver of the master."""
        # Noise rarely exceeds four standard deviations, so it rarely looks like a pulse.
        return Receiver(minimum=max(MINIMUM, 4 * FILTERED * self.noise))

    @cached_property
    def wave(self) -> Waveform:
        """The voltage at the master while the slave responds, including noise."""
        plan = line(
            self.length,
            slaves=(min(self.place, self.length),),
            cable=CABLE_CHOICES[self.cable],
            terminator=100.0 if self.terminator else None,
        )
        node = plan.slaves[0].node
        wave = plan.waveform(Response(self.data), node, dt=STEP, before=BEFORE, after=AFTER)
        return wave.disturbed(Noise(), self.noise, self.seed)

    @cached_property
    def result(self) -> Reception:
        """The response as the master receives it."""
        return self.wave.receive(self.receiver)

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the voltage with the pulses that the receiver finds."""
        return self.result.plot(self.wave, ax, receiver=self.receiver)

    def _view(self) -> View:
        sent, read = Response(self.data).bits, ""
        try:
            read = self._read()
            verdict = f"read {read}: {Response.parse(read)}"
        except FrameError as error:
            verdict = f"{type(error).__name__}: {error}"
        if read and read != sent:
            verdict = f"read {read}, but {sent} was sent: the fault went undetected"
        within = bool(self.result.within_tolerance)
        if read == sent and not within:
            verdict += "; the pulses are outside their tolerance"
        return View(
            verdict=verdict,
            ok=read == sent and within,
            numbers=self._numbers(),
            plot=self.plot,
            about="Voltage at the master over time, and the pulses that the receiver finds",
        )

    def _read(self) -> str:
        """Return the bits that the master reads, or raise the FrameError of the first failure."""
        if self.result.error == SilenceError.code:
            raise SilenceError("no pulse rises above the noise")
        return self.result.pulses.decode()

    def _numbers(self) -> dict[str, str]:
        """Return the signal amplitude, the uniformity of the pulses, and the ringing."""
        heard, swing = self.result, {"signal": f"{np.ptp(self.wave.u):.1f} Vpp"}
        if np.isnan(heard.amplitude):
            return swing
        evenness, ringing = TOLERANCE
        return {
            **swing,
            "first pulse": f"{heard.amplitude:.2f} V",
            "weakest pulse": f"{heard.weakest:.1%} of the largest, {evenness:.0%} required",
            "ringing": f"{heard.ringing:.1%} of the largest, at most {ringing:.0%} allowed",
        }
