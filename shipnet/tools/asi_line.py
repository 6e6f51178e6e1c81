"""The line explorer: a slave answers over a cable, and the master says what it makes of it."""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType

import ipywidgets as widgets
import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes

from shipnet import style
from shipnet.asi.apm import HALF_BIT
from shipnet.asi.receiver import (
    AMPLITUDE_TOLERANCE,
    MINIMUM,
    RINGING_TOLERANCE,
    Reception,
    matched_filter,
    receive,
)
from shipnet.asi.response import Response
from shipnet.asi.slots import bits_of_slots
from shipnet.asi.topology import straight_line
from shipnet.errors import ArgumentError, FrameError, SilenceError
from shipnet.line import CABLES, Cable
from shipnet.tools._view import BAD, GOOD, Board, follow

__all__ = ["CABLE_CHOICES", "Inputs", "Result", "draw", "explorer", "update"]

#: Cables to choose from. The corners combine the limits of a data sheet, 0.5 to 0.75 uH/m and at
#: most 80 pF/m (Lapp, UNITRONIC BUS ASI); their resistance is that of the nominal cable.
CABLE_CHOICES = MappingProxyType(
    {
        "nominal: 100 ohm, 6.5 ns/m": CABLES["as-i"],
        "lossless: 100 ohm, 6.5 ns/m": CABLES["as-i lossless"],
        "low: 79 ohm, 6.3 ns/m": Cable(r=0.06, l=0.5e-6, c=80e-12),
        "slow: 97 ohm, 7.7 ns/m": Cable(r=0.06, l=0.75e-6, c=80e-12),
    }
)

#: Sampling interval, length of the record and begin of the answer in it [s].
STEP, DURATION, START = 250e-9, 76.8e-6, 6e-6

#: Standard deviation of white noise behind the matched filter over that before it: the root of
#: 8/3 of the sampling interval in half-bits.
FILTERED = (8 / 3 * STEP / HALF_BIT) ** 0.5

Floats = npt.NDArray[np.floating]


@dataclass(frozen=True, slots=True)
class Inputs:
    """What the sliders say.

    Parameters
    ----------
    length : float, default 100
        Length of the cable, 1..500 [m].
    place : float, default 5
        Distance of the slave from master and supply [m]; beyond the end means at the end.
    cable : str, default the nominal one
        Key of `CABLE_CHOICES`.
    terminator : bool, default False
        Whether 100 ohm end the cable.
    noise : float, default 0
        Standard deviation of white noise at the master, sampled at 4 MS/s [V].
    data : int, default 6
        What the slave answers, 0..15.
    seed : int, default 0
        Of the noise: another seed, another try.

    Raises
    ------
    ArgumentError
        If a value is outside its range.
    """

    length: float = 100.0
    place: float = 5.0
    cable: str = next(iter(CABLE_CHOICES))
    terminator: bool = False
    noise: float = 0.0
    data: int = 6
    seed: int = 0

    def __post_init__(self) -> None:
        """Check the ranges."""
        if not 1 <= self.length <= 500:
            raise ArgumentError(f"length is {self.length} m; it must be 1..500 m")
        if not 0 <= self.place < np.inf:
            raise ArgumentError(f"place is {self.place} m; it must be 0 m or more")
        if self.cable not in CABLE_CHOICES:
            known = ", ".join(map(repr, CABLE_CHOICES))
            raise ArgumentError(f"cable is {self.cable!r}; it must be one of {known}")
        if not 0 <= self.noise <= 10:
            raise ArgumentError(f"noise is {self.noise} V; it must be 0..10 V")


@dataclass(frozen=True, eq=False, slots=True)
class Result:
    """What the master makes of the answer.

    Attributes
    ----------
    t, u : ndarray of float, shape (n_t,)
        Time from the start of the answer [s], and the voltage at the master [V].
    filtered : ndarray of float, shape (n_t,)
        The same behind the receiver's filter [V].
    sent : str
        The seven bits that the slave sent.
    reception : Reception
        What the receiver found.
    error : FrameError or None
        What it finds wrong, if anything.
    """

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
                f"{found.weakest:.0%} of the largest, {AMPLITUDE_TOLERANCE:.0%} needed"
            )
            texts["ringing"] = (
                f"{found.ringing:.0%} of the largest, {RINGING_TOLERANCE:.0%} allowed"
            )
        return texts


def update(inputs: Inputs) -> Result:
    """Send an answer over the line and receive it.

    Parameters
    ----------
    inputs : Inputs
        What the sliders say.

    Returns
    -------
    Result
        Waveform, bits and the error, if there is one.

    Raises
    ------
    ArgumentError
        If `data` is outside 0..15.

    Examples
    --------
    >>> update(Inputs()).verdict
    'read 0011001: response: 0110 (6)'
    >>> update(Inputs(length=200)).verdict
    'InformationError: slot 3 is empty; it is the middle of bit 1'
    """
    sent = Response(inputs.data).bits
    segment = straight_line(
        inputs.length,
        slaves=(min(inputs.place, inputs.length),),
        cable=CABLE_CHOICES[inputs.cable],
        terminator=100.0 if inputs.terminator else None,
    )
    t, (((u,),)) = segment.signals(sent, dt=STEP, duration=DURATION, start=START)
    u = u + np.random.default_rng(inputs.seed).normal(0, inputs.noise, u.size)
    # Four standard deviations keep the noise before the answer from looking like its first pulse.
    minimum = max(MINIMUM, 4 * FILTERED * inputs.noise)
    found = receive(u, STEP, len(sent), minimum=minimum)
    return Result(t - START, u, matched_filter(u, STEP), sent, found, _error_of(found))


def _error_of(found: Reception) -> FrameError | None:
    if found.error == SilenceError.code:
        return SilenceError("the line holds no pulse that stands out of the noise")
    try:
        bits_of_slots(found.slots)
    except FrameError as error:
        return error
    return None


def draw(result: Result, *, ax: Axes) -> Axes:
    """Draw the voltage with what the receiver sees in it.

    Parameters
    ----------
    result : Result
        What `update` returned.
    ax : matplotlib.axes.Axes
        Where to draw.

    Returns
    -------
    matplotlib.axes.Axes
        The axes given; x is in microseconds from the start of the answer.

    Examples
    --------
    >>> from matplotlib.figure import Figure
    >>> ax = draw(update(Inputs()), ax=Figure().subplots())
    >>> [line.get_label() for line in ax.lines[:4]]
    ['on the line', 'behind the filter', 'pulse', 'none']
    """
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


def explorer() -> widgets.VBox:
    """Return the sliders with the figure that follows them.

    Returns
    -------
    ipywidgets.VBox
        To be shown as the last value of a notebook's cell.

    Examples
    --------
    >>> sliders, verdict, image = explorer().children
    >>> "read 0011001" in verdict.value
    True
    """
    wide = {"style": {"description_width": "9em"}, "layout": {"width": "30em"}}
    controls = {
        "length": widgets.FloatSlider(
            100, min=10, max=300, step=5, description="length [m]", **wide
        ),
        "place": widgets.FloatSlider(5, min=0, max=300, step=5, description="slave at [m]", **wide),
        "cable": widgets.Dropdown(options=list(CABLE_CHOICES), description="cable", **wide),
        "terminator": widgets.Checkbox(False, description="100 ohm at the end", **wide),
        "noise": widgets.FloatSlider(0, min=0, max=1.5, step=0.05, description="noise [V]", **wide),
        "data": widgets.IntSlider(6, min=0, max=15, description="data", **wide),
        "seed": widgets.IntSlider(0, min=0, max=99, description="try", **wide),
    }
    board = Board()

    def show() -> None:
        result = update(Inputs(**{name: control.value for name, control in controls.items()}))
        colour = GOOD if result.read == result.sent else BAD
        board.show(result.verdict, colour, result.numbers, lambda ax: draw(result, ax=ax), 3.6)

    follow(show, controls.values())
    rows = list(controls.values())
    columns = widgets.HBox([widgets.VBox(rows[:4]), widgets.VBox(rows[4:])])
    return widgets.VBox([columns, *board.parts])
