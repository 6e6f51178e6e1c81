"""Disturbance voltages between the wires, to be added to telegrams, and immunity test levels.

No standard states what fraction of a test level appears between the wires, so users must choose
the amplitudes.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from shipnet import datasets, style
from shipnet.arrays import Floats
from shipnet.errors import ArgumentError
from shipnet.fields import check_fields, check_scalar, number, record, whole
from shipnet.lazy import Axes, pd

#: Spacing of the samples whose standard deviation is the amplitude of noise [s].
_SPACING = 250e-9

#: Start and end of a telegram in its record [s].
Span = tuple[float, float]


def _step(t: Floats) -> float:
    """Return the step of evenly spaced times [s]."""
    return float(t[-1] - t[0]) / (t.size - 1)


def add_events(
    u: Floats,
    t: Floats,
    begin: Floats,
    length: float,
    shape: Callable[..., Floats],
    *parameters: Floats,
) -> None:
    """Add ``shape(time since begin, *parameters)`` to each row of `u`, for at most `length` [s].

    `begin` and each parameter have one value per row. Samples outside the record are ignored.
    """
    dt = _step(t)
    first = np.ceil((begin - t[0]) / dt).astype(np.intp)
    column = first[:, np.newaxis] + np.arange(int(length / dt) + 1)
    row, index = np.nonzero((column >= 0) & (column < t.size))
    column = column[row, index]
    since = np.maximum(t[column] - begin[row], 0.0)
    u[row, column] += shape(since, *(parameter[row] for parameter in parameters))


#: Time constants of decay and rise [s]: a pulse rises from 10 % to 90 % in 5 ns and stays above
#: half for 50 ns, the nominal values of IEC 61000-4-4.
_DECAY, _RISE = 55.61e-9, 3.291e-9

#: Pulses per second in a packet [1/s]; IEC 61000-4-4 also specifies 100 kHz.
PULSE_RATE = 5e3

#: Length and period of packets [s], as in IEC 61000-4-4; at 5 kHz, each has 75 pulses.
PACKET_LENGTH, PACKET_PERIOD = 15e-3, 300e-3

#: Corner frequency of a receiver's input low-pass filter [Hz]: assumed, 1.5 times the 667 kHz at
#: which the spectrum of an AS-i pulse has its first zero.
INPUT_CORNER = 1e6

#: Number of time constants after which an exponential is cut off, when 2e-9 of it is left.
_ENOUGH = 20.0

# Time of a pulse's peak [s], at which both exponentials fall equally fast.
_TOP_AT = np.log(_DECAY / _RISE) * _DECAY * _RISE / (_DECAY - _RISE)

#: Area of a pulse of height 1 [s].
AREA = (_DECAY - _RISE) / float(np.exp(-_TOP_AT / _DECAY) - np.exp(-_TOP_AT / _RISE))


#: Time constants of the three low-passes in series that shape a pulse [s].
_CONSTANTS = np.array([_DECAY, _RISE, 1 / (2 * np.pi * INPUT_CORNER)])


def _mean(since: Floats, dt: float) -> Floats:
    """Return the fraction of a filtered pulse's area between `since` - `dt` and `since` [s]."""
    apart = _CONSTANTS[:, np.newaxis] - _CONSTANTS
    np.fill_diagonal(apart, 1.0)
    share = _CONSTANTS**2 / apart.prod(axis=1)
    ends = np.stack([np.maximum(since - dt, 0.0), since])
    before, after = np.exp(-ends[..., np.newaxis] / _CONSTANTS) @ share
    return np.asarray(before - after)


@record
class Noise:
    r"""White noise; its amplitude is the standard deviation of samples 250 ns apart.

    Samples :math:`\Delta t` apart have a bandwidth of :math:`1 / 2 \Delta t`, here 2 MHz, and a
    one-sided density of :math:`\sigma \sqrt{2 \Delta t}`, 0.71 mV per root hertz for 1 V. With
    another step, the density is the same, and error rates after a matched filter hardly change.

    Examples
    --------
    >>> print(f"{1e3 * Noise().density(0.7):.2f} mV per root hertz")
    0.49 mV per root hertz
    """

    def density(self, amplitude: npt.ArrayLike) -> Floats:
        """Return the density [V per root hertz] of noise of standard deviation `amplitude` [V]."""
        return np.asarray(np.multiply(amplitude, (2 * _SPACING) ** 0.5))

    def voltage(
        self, t: Floats, amplitude: float, rng: np.random.Generator, size: int, *, span: Span
    ) -> Floats:
        """Return the noise on `size` telegrams."""
        dt = _step(t)
        # At the usual step the factor is 1 except for rounding, which must not change the noise.
        if abs(dt / _SPACING - 1) >= 1e-9:
            amplitude *= (_SPACING / dt) ** 0.5
        return amplitude * rng.standard_normal((size, t.size))


@record
class Impulses:
    r"""Impulses on every telegram: raised cosines of random position, sign, height and width.

    .. math:: u(t) = \pm \frac{a}{2} \left(1 + \cos \frac{2 \pi (t - t_0)}{w}\right),
              \qquad |t - t_0| < \frac{w}{2}

    The amplitude is the mean height. Heights are uniformly distributed between 1 - `spread` and
    1 + `spread` times the amplitude, and full widths between the two values of `width` [s]. These
    ranges are assumed: impulses from coils and converters differ from ship to ship.

    Examples
    --------
    >>> t = np.arange(256) * 250e-9
    >>> rng = np.random.default_rng(2024)
    >>> u = Impulses(width=(3e-6, 3e-6)).voltage(t, 2.0, rng, 1000, span=(0, 42e-6))
    >>> print(f"{abs(u).max(axis=1).mean():.1f} V")
    2.0 V
    """

    count: int = whole(0, 1000, "", "Impulses per telegram", default=1)
    width: tuple[float, float] = (0.5e-6, 4e-6)
    spread: float = number(0, 1, "", "Relative spread of the heights", default=0.5)

    def voltage(
        self, t: Floats, amplitude: float, rng: np.random.Generator, size: int, *, span: Span
    ) -> Floats:
        """Return the impulses on `size` telegrams."""
        longest = float(t[-1] - t[0])
        if not (np.shape(self.width) == (2,) and 0 < self.width[0] <= self.width[1] <= longest):
            raise ArgumentError(
                f"width is {self.width!r}; it must be two durations in ascending order, above 0 "
                f"and up to {longest:g} s"
            )
        (narrow, wide), (first, last) = self.width, span
        u = np.zeros((size, t.size))

        def raised_cosine(since: Floats, width: Floats, height: Floats) -> Floats:
            return np.where(since < width, height * np.sin(np.pi * since / width) ** 2, 0.0)

        for _ in range(self.count):
            w = rng.uniform(narrow, wide, size)
            height = amplitude * rng.uniform(1 - self.spread, 1 + self.spread, size)
            height *= rng.choice([-1.0, 1.0], size)
            begin = rng.uniform(first, last, size) - w / 2
            add_events(u, t, begin, wide, raised_cosine, w, height)
        return u


@record
class ConductedRF:
    r"""An amplitude-modulated carrier, as in the immunity test with conducted RF voltages.

    .. math:: u(t) = a \bigl(1 + m \sin(2 \pi f_m t + \psi)\bigr) \sin(2 \pi f t + \varphi)

    The amplitude is the peak of the carrier without modulation; a test level of IEC 61000-4-6 is
    its RMS value. The upper sideband must be below half the sampling rate: for 80 MHz, choose
    a waveform with a step of 5 ns.

    Examples
    --------
    >>> t = np.arange(2000) * 1e-6
    >>> rng = np.random.default_rng(2024)
    >>> u = ConductedRF(200e3).voltage(t, 1.0, rng, 1, span=(0, 42e-6))
    >>> round(float(abs(u).max()), 1)
    1.8
    """

    frequency: float = number(1e-3, 1e12, "Hz", "Carrier frequency; in tests, 150 kHz to 80 MHz")
    modulation: float = number(0, 1, "", "Depth of the amplitude modulation", default=0.8)
    f_mod: float = number(0, 1e12, "Hz", "Frequency of the modulation", default=1e3)

    def __post_init__(self) -> None:
        check_fields(self)
        check_scalar("f_mod", self.f_mod, "Hz", 0, self.frequency)

    def voltage(
        self, t: Floats, amplitude: float, rng: np.random.Generator, size: int, *, span: Span
    ) -> Floats:
        """Return the carrier on `size` telegrams, with random phases of carrier and modulation."""
        dt = _step(t)
        f, f_mod = self.frequency, self.f_mod
        if f + f_mod >= 0.5 / dt:
            raise ArgumentError(
                f"frequency is {f:g} Hz; with its sideband it must be below {0.5 / dt:.6g} Hz, "
                "half the sampling rate"
            )
        carrier, slow = rng.uniform(0, 2 * np.pi, (2, size))
        # Carrier and sidebands, the same for all telegrams except for complex factors.
        lines = np.exp(2j * np.pi * np.outer([f, f + f_mod, f - f_mod], t))
        side = self.modulation / 2j * np.exp(1j * carrier)
        factors = [np.exp(1j * carrier), side * np.exp(1j * slow), -side * np.exp(-1j * slow)]
        return amplitude * (np.stack(factors, axis=-1) @ lines).imag


@record
class Burst:
    """Electrical fast transients, 5/50 ns as in IEC 61000-4-4, after a receiver's input filter.

    The amplitude is the peak of a pulse between the wires, before the filter. Pulses come at a
    constant rate; the sign and phase of their train are random for each telegram. A first-order
    low-pass of 1 MHz filters each pulse, and each sample is the mean over the step before it. The
    filter and the averaging, which are assumed for a receiver, preserve a pulse's area. At 5 kHz,
    one response in five is hit. Packets of 15 ms come every 300 ms; see `burst_failures`.

    Examples
    --------
    >>> t = np.arange(256) * 250e-9
    >>> u = Burst().voltage(t, 50.0, np.random.default_rng(2024), 10_000, span=(0, 42e-6))
    >>> print(f"{(abs(u).max(axis=1) > 0.1).mean():.0%} of the records are hit")
    33% of the records are hit
    """

    rate: float = number(1, 1e6, "1/s", "Pulses per second", default=PULSE_RATE)

    def voltage(
        self, t: Floats, amplitude: float, rng: np.random.Generator, size: int, *, span: Span
    ) -> Floats:
        """Return the train of pulses on `size` telegrams."""
        dt = _step(t)
        length = dt + _ENOUGH * float(_CONSTANTS.max())
        sign = amplitude * AREA / dt * rng.choice([-1.0, 1.0], size)
        begin = t[0] - length + rng.uniform(0, 1 / self.rate, size)
        u = np.zeros((size, t.size))
        for _ in range(int((t[-1] - t[0] + length) * self.rate) + 1):
            add_events(u, t, begin, length, lambda since, sign: sign * _mean(since, dt), sign)
            begin = begin + 1 / self.rate
        return u


#: Parameters that define the severity of a test; the others define its kind.
_SEVERITY = ["voltage", "peak voltage", "field strength", "highest frequency"]
_SEVERITY += ["voltage over that of the supply"]


def gaps(asi: Floats, marine: Floats, better: npt.NDArray[np.str_]) -> npt.NDArray[np.str_]:
    """Compare AS-i levels with marine ones; `better` is "higher", "lower" or "equal"."""
    ratio = asi / marine
    # Levels are round numbers; a difference of one part in a million is not a gap.
    fine = np.select(
        [better == "higher", better == "lower"],
        [ratio > 1 - 1e-6, ratio < 1 + 1e-6],
        np.abs(ratio - 1) < 1e-6,
    )
    names = ["not asked", "test missing", "covers"]
    return np.select([np.isnan(marine), np.isnan(asi), fine], names, "below")


def levels() -> pd.DataFrame:
    """Return the immunity tests of AS-i and of ships, and the gaps between their levels.

    Returns
    -------
    pandas.DataFrame
        One row per parameter of a test: both levels, their ratio, gap and sources. ``gap`` is
        "covers", "below", "test missing" (no AS-i test) or "not asked" (no marine test).
        ``asi_printed`` is the text in kim2023's Table 2, ``asi`` the value meant. If ``confirmed``
        is "yes", a public page of a type-tested product or of a test house gives the marine
        value; if "no", the value is general knowledge: confirm it before using it.

    Notes
    -----
    A test level of 1 kV is not 1 kV between the wires: the coupling depends on cable, earthing
    and symmetry.

    Examples
    --------
    >>> table = levels()
    >>> table.loc[table["gap"] == "below", ["test", "asi", "marine", "unit"]].values.tolist()
    [['electrostatic discharge, contact', 4.0, 6.0, 'kV'], ['radio-frequency field', 1000.0, 2000.0, 'MHz']]
    """  # noqa: E501 - the output is one line
    table = datasets.read("emc_levels.csv")
    table[["asi", "marine"]] = table[["asi", "marine"]].apply(pd.to_numeric)
    table["ratio"] = table["asi"] / table["marine"]
    table["gap"] = gaps(*(table[name].to_numpy() for name in ("asi", "marine", "better")))
    first = "test parameter unit asi_printed asi criterion marine ratio gap better".split()
    return table[[*first, "printed_name", "standard", "source", "confirmed", "note"]]


@style.applied
def plot_levels(ax: Axes | None = None) -> Axes:
    """Draw the ratio of AS-i test levels to marine ones, one row per test.

    Parameters
    ----------
    ax : matplotlib.axes.Axes, optional
        Axes to draw on.

    Returns
    -------
    matplotlib.axes.Axes
        The axes.

    Examples
    --------
    >>> print(plot_levels().get_xlabel())
    AS-i level over marine level
    """
    ax, table = style.axes(ax, figsize=(6.4, 5.2)), levels()
    drawn = table["parameter"].isin(_SEVERITY) & (table["gap"] != "not asked")
    rows = table[drawn].to_dict("records")
    for y, row in enumerate(rows):
        missing, unsure = row["gap"] == "test missing", row["confirmed"] != "yes"
        colour = "C0" if row["gap"] == "covers" else style.LIMIT["color"]
        x = 1.0 if missing else row["ratio"]
        if not missing:
            ax.plot([1, x], [y, y], color=colour, linewidth=3, alpha=0.5)
            ax.plot([x], [y], "o", color=colour, markerfacecolor="white" if unsure else colour)
        tested = "no test" if missing else f"{row['asi']:g}"
        text = f"{tested} / {row['marine']:g} {row['unit']}"
        text += "\n(not confirmed)" if unsure else ""
        ax.annotate(text, (max(x, 1.0), y), (7, 0), textcoords="offset points", va="center")
    colour, dashes = style.LIMIT["color"], style.LIMIT["linestyle"]
    ax.axvline(1, color=colour, linestyle=dashes, zorder=0)
    above: dict[str, Any] = {"xycoords": ax.get_xaxis_transform(), "textcoords": "offset points"}
    ax.annotate("required on ships", (1, 1), (0, 3), ha="center", color=colour, **above)
    names = [row["test"] + ("" if row["unit"] != "MHz" else ", highest frequency") for row in rows]
    ax.set_yticks(range(len(rows)), [name.replace(", ", ",\n") for name in names])
    ax.set_xscale("log")
    ax.set_xticks([0.5, 1, 2, 5], ["0.5", "1", "2", "5"])
    ax.minorticks_off()
    ax.set(xlim=(0.32, 20), ylim=(len(rows) - 0.5, -0.5))
    ax.set_xlabel("AS-i level over marine level")
    ax.grid(visible=False, axis="y")
    return ax
