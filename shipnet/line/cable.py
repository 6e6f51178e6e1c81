"""Cables given by their constants per metre, a catalogue of cables, and a pulse on a cable."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from shipnet import style
from shipnet.arrays import Complexes, Floats
from shipnet.errors import ArgumentError
from shipnet.fields import (
    Quantity,
    check_fields,
    check_quantity,
    check_scalar,
    check_trees,
    check_whole,
    number,
    record,
)
from shipnet.lazy import Axes
from shipnet.line.waveform import laplace_grid, synthesize

#: Bounds of the constants; l and c are above 0, so that sqrt(l / c) and sqrt(l c) are too. The most
#: l [H/m] and c [F/m] are far above those of any cable, but below a value given in uH/m or pF/m.
LEAST, MOST, MOST_L, MOST_C = 1e-18, 1e12, 1e-3, 1e-6


@dataclass(frozen=True, eq=False)
class Pulse:
    """A travelling pulse: positions [m], times [s], voltages [V] of shape (n_steps, n_places)."""

    x: Floats
    t: Floats
    u: Floats

    @style.applied
    def plot(self, ax: Axes | None = None, *, step: int) -> Axes:
        """Draw the pulse at time step `step`, and the range of voltages reached so far in grey."""
        ax = style.axes(ax)
        lowest, highest = min(self.u.min(), 0.0), max(self.u.max(), 0.0)
        margin = 0.08 * (highest - lowest)
        reached = self.u[: step + 1]
        ax.fill_between(
            self.x, reached.min(axis=0), reached.max(axis=0), color="0.9", label="reached so far"
        )
        ax.plot(self.x, self.u[step], label="now")
        ax.set(xlim=(self.x[0], self.x[-1]), ylim=(lowest - margin, highest + margin))
        ax.set(xlabel="position [m]", ylabel="voltage [V]")
        text = f"{self.t[step] * 1e9:.0f} ns"
        ax.text(0.98, 0.95, text, transform=ax.transAxes, ha="right", va="top")
        return ax


@record
class Cable:
    r"""A uniform two-wire cable, given by its constants per metre for both wires together.

    .. math:: z(s) = r \sqrt{1 + \frac{s}{2 \pi f_{skin}}} + s l, \qquad y(s) = g + s c

    Each constant may be an array with one value per tree of a Monte Carlo simulation.

    Examples
    --------
    >>> cable = Cable(r=0.06, l=0.65e-6, c=65e-12)
    >>> print(f"{cable.z0:.0f} ohm, {cable.delay * 1e9:.1f} ns/m")
    100 ohm, 6.5 ns/m
    >>> print(f"{cable.reflection(25):.2f} of a fast wave returns from 25 ohm")
    -0.60 of a fast wave returns from 25 ohm
    """

    r: Quantity = number(
        0, MOST, "ohm/m", "Resistance of the loop at signal frequencies", many=True
    )
    l: Quantity = number(LEAST, MOST_L, "H/m", "Inductance", many=True)  # noqa: E741
    c: Quantity = number(LEAST, MOST_C, "F/m", "Capacitance", many=True)
    g: Quantity = number(0, MOST, "S/m", "Conductance of the insulation", default=0.0, many=True)
    skin: Quantity = number(
        0,
        MOST,
        "Hz",
        "Corner frequency above which the skin effect raises `r`; 0 keeps it constant",
        default=0.0,
        many=True,
    )
    r_dc: Quantity | None = number(
        0,
        MOST,
        "ohm/m",
        "Resistance of the loop at direct current; `r` if omitted",
        default=None,
        optional=True,
        many=True,
    )

    def __post_init__(self) -> None:
        check_fields(self)
        check_trees("a cable", None, *self.parameters)

    @property
    def parameters(self) -> tuple[Quantity, ...]:
        """The constants r, l, c, g and skin, and the DC resistance."""
        return self.r, self.l, self.c, self.g, self.skin, self.resistance

    @property
    def resistance(self) -> Quantity:
        """DC resistance of the loop [ohm/m]."""
        return self.r if self.r_dc is None else self.r_dc

    @classmethod
    def lossless(cls, z0: npt.ArrayLike, delay: npt.ArrayLike) -> Cable:
        """Return the lossless cable with this characteristic impedance [ohm] and delay [s/m]."""
        impedance = np.asarray(check_quantity("z0 of a cable", z0, "ohm", low=0.1, high=1e4))
        per_metre = np.asarray(
            check_quantity("delay of a cable", delay, "s/m", low=1e-12, high=1e-7)
        )
        check_trees("a cable", None, impedance[()], per_metre[()])
        return cls(0.0, (impedance * per_metre)[()], (per_metre / impedance)[()])

    @property
    def z0(self) -> Quantity:
        """Characteristic impedance sqrt(l / c) for a fast signal [ohm]."""
        return _root(np.divide(self.l, self.c))

    @property
    def delay(self) -> Quantity:
        """Delay sqrt(l c) of a fast signal [s/m]."""
        return _root(np.multiply(self.l, self.c))

    def series_impedance(self, s: npt.ArrayLike) -> Complexes:
        """Return the impedance z per metre [ohm/m] of both wires, at complex frequencies s."""
        s = np.asarray(s, dtype=complex)
        r, skin = np.expand_dims(self.r, -1), np.expand_dims(self.skin, -1)
        if np.any(skin > 0):
            corner = np.where(skin > 0, skin, 1.0)
            # The square root also adds the internal inductance that causality requires.
            r = np.where(skin > 0, r * np.sqrt(1 + s / (2 * np.pi * corner)), r)
        return np.asarray(r + s * np.expand_dims(self.l, -1))

    def shunt_admittance(self, s: npt.ArrayLike) -> Complexes:
        """Return the admittance y per metre [S/m] between the wires, at complex frequencies s."""
        s = np.asarray(s, dtype=complex)
        return np.asarray(np.expand_dims(self.g, -1) + s * np.expand_dims(self.c, -1))

    def propagation(self, s: npt.ArrayLike) -> Complexes:
        """Return the propagation constant sqrt(z y): attenuation [Np/m] and phase [rad/m]."""
        # The root of the product would change sign where z y crosses the negative real axis.
        return np.asarray(np.sqrt(self.series_impedance(s)) * np.sqrt(self.shunt_admittance(s)))

    def attenuation(self, f: npt.ArrayLike) -> Floats:
        """Return the attenuation of a wave of frequency f [Hz], in dB/m."""
        gamma = self.propagation(2j * np.pi * np.asarray(f, dtype=float))
        return np.asarray(20 / np.log(10) * gamma.real)

    def reflection(self, end: float | None) -> float:
        """Return the reflection factor of a resistor `end` [ohm], or of an open end (None)."""
        if end is None:
            return 1.0
        ohms = check_scalar("end", end, "ohm", 1e-18, 1e18)
        return float((ohms - self.z0) / (ohms + self.z0))

    def pulse(
        self,
        length: float = 100.0,
        end: float | None = None,
        *,
        width: float = 100e-9,
        n_steps: int = 31,
    ) -> Pulse:
        """Simulate a Gaussian pulse of 1 V and standard deviation `width` [s] and its echo.

        The near end is matched; the far end has a resistor `end` [ohm] or is open (None). The
        result ends when the echo returns. `width` must be 1/200 to 2 times the cable's delay.
        """
        metres = check_scalar("length", length, "m", 1.0, 1e5)
        steps = check_whole("n_steps", n_steps, 2, 10_000)
        if any(np.ndim(constant) for constant in self.parameters):
            raise ArgumentError("cable has constants that are arrays; a pulse needs a single cable")
        delay, z0 = float(self.delay) * metres, float(self.z0)
        sigma = check_scalar("width", width, "s", delay / 200, 2 * delay)
        ohms = np.inf if end is None else check_scalar("end", end, "ohm", 1e-18, 1e18)
        x = np.linspace(0.0, metres, 201)
        t = np.linspace(0.0, 2 * delay, steps)

        # The pulse begins six standard deviations before its middle, when it is 1e-8 V.
        early = 6 * sigma
        before = int(np.ceil(early / t[1]))
        n_samples = before + steps + int(np.ceil((2 * delay + early) / t[1]))
        duration = n_samples * t[1]
        s = laplace_grid(duration, 1.5 / sigma)
        sent = sigma * np.sqrt(2 * np.pi) * np.exp((s * sigma) ** 2 / 2 - s * before * t[1])
        gamma = self.propagation(s)
        wave = np.sqrt(self.series_impedance(s) / self.shunt_admittance(s))
        rho = (1 - wave / ohms) / (1 + wave / ohms)
        echo = rho * np.exp(-2 * gamma * metres)
        # The source sees its own resistor and the cable in parallel.
        forward = 2 / z0 * sent / ((1 + echo) / z0 + (1 - echo) / wave)
        away, home = (np.exp(-gamma * way[:, np.newaxis]) for way in (x, 2 * metres - x))
        u = synthesize(forward * (away + rho * home), n_samples, duration)
        return Pulse(x, t, u[:, before : before + steps].T.copy())


def _root(square: Quantity) -> Quantity:
    root = np.sqrt(square)
    return root if isinstance(root, np.ndarray) else float(root)


def _asi(r: float, r_dc: float) -> Cable:
    return Cable(r=r, l=0.65e-6, c=65e-12, r_dc=r_dc)


#: Cables by name; the number in an ``as-i`` name is the cross-section of a conductor [mm2].
#:
#: ``as-i``: l and c meet a data sheet's 0.5 to 0.75 uH/m, at most 80 pF/m and 70 to 140 ohm [1]_.
#: At 1 A DC, the voltage drop on 100 m is 5.2, 2.7 and 1.6 V [2]_; the data sheets allow 27.4 [1]_
#: and 16.4 mohm/m [3]_ for the thicker two. The resistance at about 150 kHz is assumed; its ratio
#: to the DC resistance is nearly the same for all. ``as-i lossless``: the same l and c without
#: loss. ``can`` and ``rs-485``: nominal characteristic impedance and delay of [4]_, lossless; [5]_
#: gives the same 120 ohm but no delay.
#:
#: .. [1] Lapp, UNITRONIC BUS ASI, data sheet.
#: .. [2] Schneider Electric, AS-i help D-SA-0011271.
#: .. [3] Lapp, UNITRONIC BUS ASI LD G, data sheet.
#: .. [4] ISO 11898-2:2003, nominal impedance 120 ohm, specific line delay 5 ns/m.
#: .. [5] TIA/EIA-485-A, 1998.
CABLES: Mapping[str, Cable] = MappingProxyType(
    {
        "as-i 0.75": _asi(0.116, 0.052),
        "as-i 1.5": _asi(0.06, 0.027),
        "as-i 2.5": _asi(0.036, 0.016),
        "as-i lossless": Cable.lossless(100.0, 6.5e-9),
        "can": Cable.lossless(120.0, 5e-9),
        "rs-485": Cable.lossless(120.0, 5e-9),
    }
)
