r"""A pulse that travels along a cable and comes back: the voltage over place and time.

The near end is matched, so that a wave which has returned leaves the line; the far end is open or
has a resistor. A pulse of 1 V goes out, and returns times the reflection factor

.. math:: \rho = \frac{R - Z_0}{R + Z_0}

of the far end: 1 if it is open, 0 if it is matched, negative below the wave impedance.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar, check_whole
from shipnet.line.cable import Cable
from shipnet.line.laplace import laplace_grid, synthesize
from shipnet.line.network import CableRun, Load, Network

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Pulse:
    """A pulse on its way: places [m], times [s] and voltages [V] of shape (n_steps, n_places)."""

    x: Floats
    t: Floats
    u: Floats

    def plot(self, ax: Axes | None = None, *, step: int) -> Axes:
        """Draw the pulse at one of its times, with all that it has reached so far in grey."""
        from shipnet.line.plot import plot_pulse

        return plot_pulse(self, step, ax=ax)


def send_pulse(
    cable: Cable,
    length: float = 100.0,
    end: float | None = None,
    *,
    width: float = 100e-9,
    n_places: int = 201,
    n_steps: int = 31,
) -> Pulse:
    """Return a pulse of 1 V on its way to the far end and back, from when it leaves to its return.

    The pulse is Gaussian with the standard deviation `width` [s], at least a 200th of the delay
    of the cable and at most twice that delay.
    """
    metres = check_scalar("length", length, "m", 1.0, 1e5)
    places = check_whole("n_places", n_places, 2, 2001)
    steps = check_whole("n_steps", n_steps, 2, 10_000)
    if np.ndim(cable.z0) or np.ndim(cable.delay):
        raise ArgumentError("cable holds many cables; a single one is asked for")
    delay, z0 = float(cable.delay) * metres, float(cable.z0)
    sigma = check_scalar("width", width, "s", delay / 200, 2 * delay)

    loads = {"0": Load(r=z0)}
    if end is not None:
        loads[f"{places - 1}"] = Load(r=check_scalar("end", end, "ohm", 1e-18, 1e18))
    section = metres / (places - 1)
    network = Network(
        [CableRun(f"{k}", f"{k + 1}", section, cable) for k in range(places - 1)], loads
    )
    x = np.linspace(0.0, metres, places)

    # The pulse begins six deviations before its middle, where it is 1e-8 V.
    early = 6 * sigma
    t = np.linspace(0.0, 2 * delay, steps)
    spacing = t[1]
    before = int(np.ceil(early / spacing))
    n_samples = before + steps + int(np.ceil((2 * delay + early) / spacing))
    duration = n_samples * spacing
    s = laplace_grid(duration, 1.5 / sigma)
    start = before * spacing
    pulse = sigma * np.sqrt(2 * np.pi) * np.exp((s * sigma) ** 2 / 2 - s * start)
    # The source sees its own resistor and the cable, equal and in parallel.
    u = synthesize(network.transfer("0", s) * pulse * 2 / z0, n_samples, duration)
    return Pulse(x, t, u[:, before : before + steps].T.copy())
