r"""A pulse that travels along a cable and comes back: the voltage over place and time.

The near end is matched, so that a wave which has returned leaves the line; the far end is open or
has a resistor. A pulse of 1 V goes out, and returns times the reflection factor

.. math:: \rho = \frac{R - Z_0}{R + Z_0}

of the far end: 1 if it is open, 0 if it is matched, negative below the wave impedance.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar, check_whole
from shipnet.line.cable import CABLES, Cable
from shipnet.line.laplace import laplace_grid, synthesize
from shipnet.line.network import Network

__all__ = ["Travel", "reflection_factor", "travel"]

Floats = npt.NDArray[np.float64]


class Travel(NamedTuple):
    """A pulse on its way.

    Attributes
    ----------
    x : ndarray, shape (n_places,)
        Places from the near end [m].
    t : ndarray, shape (n_steps,)
        Times since the middle of the pulse left the near end [s].
    v : ndarray, shape (n_steps, n_places)
        Voltage [V].
    """

    x: Floats
    t: Floats
    v: Floats


def reflection_factor(resistor: float | None, cable: Cable = CABLES["as-i"]) -> float:
    """Return which share of a fast wave the end of a cable sends back.

    Parameters
    ----------
    resistor : float or None
        Resistor at the end, 1e-18 to 1e18 [ohm]; None for an open end.
    cable : Cable, optional
        The cable; that of AS-i by default.

    Returns
    -------
    float
        -1 to 1 [1].

    Raises
    ------
    ArgumentError
        If the resistor is out of range.

    Examples
    --------
    >>> reflection_factor(None), round(reflection_factor(25), 3)
    (1.0, -0.6)
    """
    if resistor is None:
        return 1.0
    ohms = check_scalar("resistor", resistor, "ohm", 1e-18, 1e18)
    return float((ohms - cable.z0) / (ohms + cable.z0))


def travel(
    length: float = 100.0,
    resistor: float | None = None,
    *,
    cable: Cable = CABLES["as-i"],
    width: float = 100e-9,
    n_places: int = 201,
    n_steps: int = 31,
) -> Travel:
    """Return a pulse of 1 V on its way to the far end and back.

    Parameters
    ----------
    length : float, default 100
        Length of the cable, 1 to 1e5 [m].
    resistor : float, optional
        Resistor at the far end [ohm]; open without one.
    cable : Cable, optional
        The cable; that of AS-i by default.
    width : float, default 100e-9
        Standard deviation of the pulse, which is Gaussian, at least a 200th of the delay of the
        cable and at most twice that delay [s].
    n_places : int, default 201
        Places along the cable, 2 to 2001.
    n_steps : int, default 31
        Times, evenly spaced from 0 until the pulse has come back, 2 to 10 000.

    Returns
    -------
    Travel
        Places, times and voltages.

    Raises
    ------
    ArgumentError
        If an argument is out of range.

    Examples
    --------
    At an open end, going out and coming back add up: twice the voltage, less what the cable took.

    >>> pulse = travel(100)
    >>> middle = len(pulse.t) // 2
    >>> print(f"{pulse.t[middle] * 1e9:.0f} ns: {pulse.v[middle, -1]:.2f} V at the end")
    650 ns: 1.95 V at the end
    """
    metres = check_scalar("length", length, "m", 1.0, 1e5)
    places = check_whole("n_places", n_places, 2, 2001)
    steps = check_whole("n_steps", n_steps, 2, 10_000)
    if np.ndim(cable.z0) or np.ndim(cable.delay):
        raise ArgumentError("cable holds many cables; a single one is asked for")
    delay, z0 = float(cable.delay) * metres, float(cable.z0)
    sigma = check_scalar("width", width, "s", delay / 200, 2 * delay)

    network = Network()
    x = np.linspace(0.0, metres, places)
    for k in range(places - 1):
        network.line(f"{k}", f"{k + 1}", metres / (places - 1), cable)
    network.terminator("0", z0)
    if resistor is not None:
        network.terminator(f"{places - 1}", check_scalar("resistor", resistor, "ohm", 1e-18, 1e18))

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
    v = synthesize(network.transfer("0", s) * pulse * 2 / z0, n_samples, duration)
    order = [network.index(f"{k}") for k in range(places)]
    return Travel(x, t, v[order, before : before + steps].T.copy())
