"""A cable by its constants per metre: resistance, inductance, capacitance and conductance."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np
import numpy.typing as npt

from shipnet.fields import Quantity, check_quantity, check_trees

__all__ = ["CABLES", "Cable"]

#: Legal constants: l and c are not 0, so that every cable has a wave impedance and a delay.
LEAST, MOST = 1e-18, 1e12

Complexes = npt.NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class Cable:
    r"""A uniform two-wire cable.

    .. math:: z(s) = r \sqrt{1 + \frac{s}{2 \pi f_{skin}}} + s l, \qquad y(s) = g + s c

    Parameters
    ----------
    r : float or array_like, shape (n_trees,)
        Resistance of the loop at DC, not negative [ohm/m].
    l : float or array_like
        Inductance, at least 1e-18 [H/m].
    c : float or array_like
        Capacitance, at least 1e-18 [F/m].
    g : float or array_like, default 0
        Conductance of the insulation, not negative [S/m].
    skin : float or array_like, default 0
        Corner frequency above which the skin effect raises the resistance [Hz]; 0 keeps it
        constant. The square root adds the internal inductance that causality asks for.

    Raises
    ------
    ArgumentError
        If a parameter is out of range; it names the parameter, its value and the range.

    Notes
    -----
    A parameter may hold one value for each tree of a Monte Carlo; a `Network` carries this axis
    through. Two cables are equal if all their parameters are.

    Examples
    --------
    >>> cable = Cable(r=0.06, l=0.65e-6, c=65e-12)
    >>> print(f"{cable.z0:.0f} ohm, {cable.delay * 1e9:.1f} ns/m")
    100 ohm, 6.5 ns/m
    """

    r: Quantity
    l: Quantity  # noqa: E741  # the symbol of the telegraph equations
    c: Quantity
    g: Quantity = 0.0
    skin: Quantity = 0.0

    def __post_init__(self) -> None:
        """Check and store the parameters."""
        units = {"r": "ohm/m", "l": "H/m", "c": "F/m", "g": "S/m", "skin": "Hz"}
        for name, unit in units.items():
            value = check_quantity(
                f"{name} of a cable",
                getattr(self, name),
                unit,
                low=LEAST if name in ("l", "c") else 0.0,
                high=MOST,
            )
            object.__setattr__(self, name, value)
        check_trees("a cable", None, *self.parameters)

    @property
    def parameters(self) -> tuple[Quantity, Quantity, Quantity, Quantity, Quantity]:
        """The constants r, l, c, g and skin."""
        return self.r, self.l, self.c, self.g, self.skin

    def _key(self) -> tuple[Any, ...]:
        return tuple(tuple(v) if isinstance(v, np.ndarray) else v for v in self.parameters)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Cable) and self._key() == other._key()

    def __hash__(self) -> int:
        return hash(self._key())

    @classmethod
    def lossless(cls, z0: npt.ArrayLike, delay: npt.ArrayLike) -> Cable:
        """Return the lossless cable of a wave impedance and a delay.

        Parameters
        ----------
        z0 : float or array_like, shape (n_trees,)
            Wave impedance, 1e-3 to 1e6 [ohm].
        delay : float or array_like
            Delay per length, 1e-12 to 1e-3 [s/m].

        Returns
        -------
        Cable
            A cable with r = g = 0.

        Raises
        ------
        ArgumentError
            If one of them is out of range.

        Examples
        --------
        >>> cable = Cable.lossless(120, 5e-9)
        >>> print(f"{cable.l * 1e9:.0f} nH/m, {cable.c * 1e12:.1f} pF/m")
        600 nH/m, 41.7 pF/m
        """
        impedance = np.asarray(check_quantity("z0 of a cable", z0, "ohm", low=1e-3, high=1e6))
        per_metre = np.asarray(
            check_quantity("delay of a cable", delay, "s/m", low=1e-12, high=1e-3)
        )
        check_trees("a cable", None, impedance[()], per_metre[()])
        return cls(0.0, (impedance * per_metre)[()], (per_metre / impedance)[()])

    @property
    def z0(self) -> Quantity:
        """Wave impedance sqrt(l / c) that a fast signal meets [ohm]."""
        return _root(np.divide(self.l, self.c))

    @property
    def delay(self) -> Quantity:
        """Delay sqrt(l c) of a fast signal [s/m]."""
        return _root(np.multiply(self.l, self.c))

    def series_impedance(self, s: npt.ArrayLike) -> Complexes:
        """Return the impedance z of a metre of both wires.

        Parameters
        ----------
        s : array_like of complex, shape (n_s,)
            Complex frequency [rad/s].

        Returns
        -------
        ndarray of complex, shape (n_s,) or (n_trees, n_s)
            Impedance [ohm/m].

        Examples
        --------
        At three times its corner frequency, the skin effect has raised the resistance to
        1.78 times its value, the modulus of ``sqrt(1 + 3j)``:

        >>> cable = Cable(r=0.06, l=1e-12, c=65e-12, skin=100e3)
        >>> print(f"{abs(cable.series_impedance([2j * np.pi * 300e3])[0]) / 0.06:.2f}")
        1.78
        """
        s = np.asarray(s, dtype=complex)
        r, skin = np.expand_dims(self.r, -1), np.expand_dims(self.skin, -1)
        if np.any(skin > 0):
            corner = np.where(skin > 0, skin, 1.0)
            r = np.where(skin > 0, r * np.sqrt(1 + s / (2 * np.pi * corner)), r)
        return np.asarray(r + s * np.expand_dims(self.l, -1))

    def shunt_admittance(self, s: npt.ArrayLike) -> Complexes:
        """Return the admittance y between the wires of a metre.

        Parameters
        ----------
        s : array_like of complex, shape (n_s,)
            Complex frequency [rad/s].

        Returns
        -------
        ndarray of complex, shape (n_s,) or (n_trees, n_s)
            Admittance [S/m].

        Examples
        --------
        >>> Cable(r=0, l=1e-6, c=50e-12, g=1e-6).shunt_admittance([0])
        array([1.e-06+0.j])
        """
        s = np.asarray(s, dtype=complex)
        return np.asarray(np.expand_dims(self.g, -1) + s * np.expand_dims(self.c, -1))

    def propagation(self, s: npt.ArrayLike) -> Complexes:
        r"""Return the propagation constant, gamma = sqrt(z y).

        Parameters
        ----------
        s : array_like of complex, shape (n_s,)
            Complex frequency, real part not negative [rad/s].

        Returns
        -------
        ndarray of complex, shape (n_s,) or (n_trees, n_s)
            Real part, the attenuation [Np/m], and imaginary part, the phase [rad/m].

        Examples
        --------
        A nominal AS-i cable takes 0.26 dB off a wave on 100 m; 1 Np is 8.686 dB:

        >>> gamma = CABLES["as-i"].propagation([2j * np.pi * 167e3])
        >>> print(f"{100 * 8.686 * gamma.real[0]:.2f} dB")
        0.26 dB
        """
        # The product of the roots keeps the sign; the root of the product would lose it where
        # the product crosses the negative axis.
        return np.asarray(np.sqrt(self.series_impedance(s)) * np.sqrt(self.shunt_admittance(s)))


def _root(square: Quantity) -> Quantity:
    root = np.sqrt(square)
    return root if isinstance(root, np.ndarray) else float(root)


#: Cables by name.
#:
#: ``as-i``: two cores of 1.5 mm2 at signal frequencies; l and c lie inside the 0.5 to 0.75 uH/m
#: and the 80 pF/m at most of a data sheet [1]_ and give its 70 to 140 ohm; r is twice the DC loop
#: of 27 mohm/m, a value assumed for about 150 kHz. ``as-i lossless``: the same wave without loss.
#: ``can`` and ``rs-485``: nominal wave impedance and delay of the standards [2]_ [3]_, lossless;
#: [3]_ names the terminator of 120 ohm and no delay, so that of [2]_ stands for both.
#:
#: .. [1] Lapp, UNITRONIC BUS ASI, data sheet.
#: .. [2] ISO 11898-2:2003, nominal impedance 120 ohm, specific line delay 5 ns/m.
#: .. [3] TIA/EIA-485-A, 1998.
CABLES: Mapping[str, Cable] = MappingProxyType(
    {
        "as-i": Cable(r=0.06, l=0.65e-6, c=65e-12),
        "as-i lossless": Cable.lossless(100.0, 6.5e-9),
        "can": Cable.lossless(120.0, 5e-9),
        "rs-485": Cable.lossless(120.0, 5e-9),
    }
)
