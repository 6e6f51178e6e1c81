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
from shipnet.tools._view import View, words

_WORDS = words("asi_line")

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

    length: float = number(1, 500, "m", _WORDS["length"], (10, 300), default=100.0, step=5)
    place: float = number(0, 500, "m", _WORDS["place"], (0, 300), default=5.0, step=5)
    cable: str = choice(list(CABLE_CHOICES), _WORDS["cable"], default=next(iter(CABLE_CHOICES)))
    terminator: bool = switch(_WORDS["terminator"], default=False)
    noise: float = number(0, 10, "V", _WORDS["noise"], (0, 1.5), default=0.0, step=0.05)
    data: int = whole(0, 15, help=_WORDS["data"], default=6)
    seed: int = whole(0, 999, help=_WORDS["seed"], slider=(0, 99), default=0)

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
        sent, read, result = Response(self.data).bits, "", self.result
        try:
            if result.error == SilenceError.code:
                raise SilenceError("no pulse rises above the noise")
            read = result.pulses.decode()
            verdict = f"read {read}: {Response.parse(read)}"
        except FrameError as error:
            verdict = f"{type(error).__name__}: {error}"
        if read and read != sent:
            verdict = f"read {read}, but {sent} was sent: the fault went undetected"
        within = bool(result.within_tolerance)
        if read == sent and not within:
            verdict += "; the pulses are outside their tolerance"
        numbers = {"signal": f"{np.ptp(self.wave.u):.1f} Vpp"}
        if not np.isnan(result.amplitude):
            least, most = TOLERANCE
            numbers |= {
                "first pulse": f"{result.amplitude:.2f} V",
                "weakest pulse": f"{result.weakest:.1%} of the largest, {least:.0%} required",
                "ringing": f"{result.ringing:.1%} of the largest, at most {most:.0%} allowed",
            }
        return View(
            verdict=verdict,
            ok=read == sent and within,
            numbers=numbers,
            plot=self.plot,
            about="Voltage at the master over time, and the pulses that the receiver finds",
        )
