"""An AS-i segment: cable, power supply, master and slaves, and the telegrams on it as voltages.

The voltages are the signal alone: the supply of 30 V, on which it rides, is left out. The usual
shapes of segments are in `shipnet.asi.topology`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil

import numpy as np
import numpy.typing as npt

from shipnet.asi.modulation import HALF_BIT, SEND_CURRENT, as_bits, ramp_spectrum, steps_of
from shipnet.asi.receiver import Waveform
from shipnet.asi.telegram import Request, Response
from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar
from shipnet.line.network import Load, Network
from shipnet.line.waveform import laplace_grid, synthesize

#: What a slave or a master loads the line with: r [ohm], l [H] and c [F] in parallel, the limits
#: that the SAP5S/SAP51 data sheet (2012, p. 29) sets for an A/B slave.
DEVICE = Load(r=13.5e3, l=13.5e-3, c=50e-12)

#: The decoupling of the power supply, 39 ohm beside 50 uH in each wire: assumed after IEC 62026-2.
POWER_SUPPLY = Load(r=78.0, l=100e-6)

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Segment:
    """A network with the places of its master and its slaves."""

    network: Network
    master: str
    slaves: tuple[str, ...]

    def signals(
        self,
        bits: str | Sequence[str] | npt.ArrayLike,
        *,
        dt: float = 50e-9,
        duration: float = 102.4e-6,
        start: float = 5e-6,
        f_max: float = 3e6,
    ) -> tuple[Floats, Floats]:
        """Return what the master hears of each slave.

        By reciprocity it is also what each slave hears of the master.
        """
        slot, n = round(HALF_BIT / dt), ceil(round(duration / dt, 6))
        # The record is a whole number of samples; another length would stretch its time.
        duration = n * dt
        if slot < 1 or abs(slot * dt / HALF_BIT - 1) > 1e-9:
            raise ArgumentError(f"dt is {dt} s; it must be a whole fraction of {HALF_BIT} s")
        steps = np.atleast_2d(steps_of(bits)).astype(float)
        s = laplace_grid(duration, f_max)
        change = SEND_CURRENT * ramp_spectrum(s) / s * np.exp(-s * start)
        transfer = self.network.transfer(self.master, s)
        rows = [self.network.index(slave) for slave in self.slaves]
        # One change of current, heard from each slave; a telegram is a row of such changes.
        change_heard = synthesize(-transfer[..., rows, :] * change, n, duration)
        u = np.zeros((len(rows), len(steps), n))
        for place in range(steps.shape[1]):
            late = place * slot
            if late < n:
                u[:, :, late:] += steps[:, place, None] * change_heard[:, None, : n - late]
        return dt * np.arange(n, dtype=np.float64), u


def telegram_waveform(
    network: Network,
    master: str,
    nodes: tuple[str, ...],
    telegrams: Request | Response | str | Sequence[str],
    *,
    dt: float = 250e-9,
    before: float = 6.5e-6,
    after: float = 18.5e-6,
) -> Waveform:
    """Return the voltages of telegrams between the master and nodes; t = 0 is their start."""
    words = telegrams.bits if isinstance(telegrams, Request | Response) else telegrams
    bits = as_bits(words)
    early = check_scalar("before", before, "s", 0, 1.0)
    late = check_scalar("after", after, "s", 0, 1.0)
    step = check_scalar("dt", dt, "s", 1e-9, 1e-6)
    length = early + 2 * bits.shape[-1] * HALF_BIT + late
    n_t = ceil(round(length / step, 6))
    segment = Segment(network, master, nodes)
    _, u = segment.signals(bits, dt=step, duration=n_t * step, start=early)
    u = u if bits.ndim == 2 else u[:, 0]
    return Waveform(u, step, start=-early, names=nodes, bits=bits)
