"""An AS-i segment: cable, power supply, master and slaves, and the telegrams on it as voltages.

The voltages are the signal alone: the supply of 30 V, on which it rides, is left out. The usual
shapes of segments are in `shipnet.asi.topology`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from shipnet.asi.modulation import HALF_BIT, SEND_CURRENT, ramp_spectrum, steps_of
from shipnet.errors import ArgumentError
from shipnet.line.laplace import laplace_grid, synthesize
from shipnet.line.network import Load, Network

#: What a slave or a master loads the line with: r [ohm], l [H] and c [F] in parallel, the limits
#: that the SAP5S/SAP51 data sheet (2012, p. 29) sets for an A/B slave.
DEVICE = Load(r=13.5e3, l=13.5e-3, c=50e-12)

#: The decoupling of the power supply, 39 ohm beside 50 uH in each wire: assumed after IEC 62026-2.
POWER_SUPPLY = Load(r=78.0, l=100e-6)

Floats = npt.NDArray[np.floating]


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
        slot, n = round(HALF_BIT / dt), round(duration / dt)
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
