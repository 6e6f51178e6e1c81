"""The diagnosis explorer: what the sensors of a valve say, and which rules fire on it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import isnan, nan

import ipywidgets as widgets
from matplotlib.axes import Axes

from shipnet import style
from shipnet.ballast import FAULTS, Command, Fault, Sensors, simulate
from shipnet.errors import ArgumentError
from shipnet.fuzzy import NORMAL, Decision, RuleBase, crisp_strengths, decide, published, strengths
from shipnet.line.quantity import check_scalar
from shipnet.tools._view import BAD, GOOD, Board

__all__ = ["STATES", "Inputs", "Result", "draw", "explorer", "from_plant", "update"]

#: What a valve may be doing: where it starts, 0..1, what it is told, and when it is read [s].
STATES: dict[str, tuple[float, str | None, float]] = {
    "opening": (0.5, "open", 4.0),
    "closing": (0.5, "close", 4.0),
    "at rest, open": (1.0, None, 1.0),
    "at rest, closed": (0.0, None, 1.0),
}


def _base() -> RuleBase:
    return published.rule_base("kim2014")


@dataclass(frozen=True, slots=True)
class Inputs:
    """What the sensors say.

    Parameters
    ----------
    FP, OP : float, default 90 and 2
        Pump and operating pressure, 0..160 and 0..10 [bar].
    MC : float, default 1.2
        Motor current, 0..6 [A].
    OT : float, default 50
        Motor temperature, 0..150 [degC].
    VPos : float, default 50
        Position, -20..320 [%]: the paper tests with 305.
    DVPos : float, default 11
        Speed of the position, 0..30 [%/s].
    commanded : bool, default True
        A command is active and its target not reached: only then DVPos counts.
    cut : float, default 0.5
        Strength from which on a rule is active, 0.05..1.

    Raises
    ------
    ArgumentError
        If a value is out of its range. NaN is a sensor that says nothing.
    """

    FP: float = 90.0
    OP: float = 2.0
    MC: float = 1.2
    OT: float = 50.0
    VPos: float = 50.0
    DVPos: float = 11.0
    commanded: bool = True
    cut: float = 0.5

    def __post_init__(self) -> None:
        """Check the ranges."""
        for variable in _base().variables:
            value = getattr(self, variable.name)
            if not (isinstance(value, float) and isnan(value)):
                check_scalar(variable.name, value, variable.unit, variable.low, variable.high)
        check_scalar("cut", self.cut, "", 0.05, 1.0)


@dataclass(frozen=True)
class Result:
    """What the rules make of it.

    Attributes
    ----------
    inputs : Inputs
        What was asked.
    decision : Decision
        By firing strengths, of a single sample.
    printed : tuple of str
        Codes that fire by the comparisons as printed, the highest priority first.
    """

    inputs: Inputs
    decision: Decision
    printed: tuple[str, ...]

    @property
    def headline(self) -> str:
        """The first of the active codes, or ``normal``."""
        return str(self.decision.headline[0])

    @property
    def active(self) -> tuple[str, ...]:
        """All active codes, the highest priority first."""
        return self.decision.codes(0)

    @cached_property
    def strength(self) -> dict[str, float]:
        """Firing strength by code, the highest priority first."""
        firing = self.decision.firing
        return {code: float(firing.of(code)[0]) for code in firing.base.ranking}

    @property
    def numbers(self) -> dict[str, str]:
        """Codes and reason as text."""
        return {
            "why": self.decision.explain(0),
            "active codes": " ".join(self.active) or "none",
            "as printed, without ramps": " ".join(self.printed) or "none",
        }


def from_plant(
    fault: str = NORMAL, severity: float = 1.0, state: str = "opening", *, cut: float = 0.5
) -> Inputs:
    """Return what the sensors of a valve would say, by the plant model and without noise.

    Parameters
    ----------
    fault : str, default "normal"
        A code of the rule table, or ``normal``.
    severity : float, default 1
        0..1.
    state : str, default "opening"
        One of `STATES`; a valve that moves starts half open and is read after 4 s.
    cut : float, default 0.5
        As for `Inputs`.

    Returns
    -------
    Inputs
        Readings of the plant.

    Raises
    ------
    ArgumentError
        If there is no such fault or state, or a number is out of its range.

    Examples
    --------
    >>> stuck = from_plant("V1")
    >>> round(stuck.FP), round(stuck.OP), round(stuck.MC, 2), stuck.DVPos
    (128, 10, 1.55, 0.0)
    """
    if state not in STATES:
        raise ArgumentError(f"state is {state!r}; it must be one of {', '.join(STATES)}")
    start, order, duration = STATES[state]
    faults = [] if fault == NORMAL else [Fault(fault, severity)]
    orders = [] if order is None else [Command(order)]
    quiet = Sensors(noise=(0.0,) * 5, bits=None)
    run = simulate(
        commands=orders, duration=duration, faults=faults, sensors=quiet, opening=start, step=0.5
    )
    last = {name: round(float(values[-1, 0]), 6) for name, values in run.samples.items()}
    commanded = bool(run.active[-1, 0])
    return Inputs(
        **{**last, "DVPos": last["DVPos"] if commanded else 0.0}, commanded=commanded, cut=cut
    )


def update(inputs: Inputs) -> Result:
    """Let the rules fire.

    Parameters
    ----------
    inputs : Inputs
        What the sensors say.

    Returns
    -------
    Result
        Strengths, active codes, reason.

    Examples
    --------
    >>> result = update(from_plant("P2"))
    >>> result.headline, result.active
    ('P2', ('P2', 'V2'))
    >>> update(Inputs()).headline
    'normal'
    """
    base = _base()
    given = {name: [getattr(inputs, name)] for name in base.names}
    if not inputs.commanded:
        given["DVPos"] = [nan]
    decision = decide(strengths(base, given), cut=inputs.cut)
    printed = decide(crisp_strengths(base, given)).codes(0)
    return Result(inputs, decision, printed)


def draw(result: Result, *, ax: Axes) -> Axes:
    """Draw the firing strength of every rule as a bar.

    Parameters
    ----------
    result : Result
        What `update` returned.
    ax : matplotlib.axes.Axes
        Where to draw.

    Returns
    -------
    matplotlib.axes.Axes
        The axes given: active codes in orange; a cross beside a rule that fires as printed.

    Examples
    --------
    >>> from matplotlib.figure import Figure
    >>> ax = draw(update(Inputs()), ax=Figure().subplots())
    >>> ax.get_xlabel()
    'firing strength'
    """
    codes, heights = list(result.strength), list(result.strength.values())
    base = result.decision.firing.base
    colours = ["C1" if code in result.active else "C0" for code in codes]
    ax.barh(range(len(codes)), heights, color=colours, height=0.7)
    labels = [f"{code}  {base.rule(code).english}" for code in codes]
    ax.set_yticks(range(len(codes)), labels, fontsize=8)
    ax.axvline(
        result.inputs.cut, color=style.LIMIT["color"], linestyle=style.LIMIT["linestyle"],
        label="cut: active from here on",
    )  # fmt: skip
    places = [codes.index(code) for code in result.printed]
    ax.plot(
        [1.03] * len(places), places, "x", color="0.2", markersize=6, clip_on=False,
        label="fires as printed",
    )  # fmt: skip
    ax.set_ylim(len(codes) - 0.4, -0.6)
    ax.set_xlim(0, 1.06)
    ax.set_xticks([0, 0.25, 0.5, 0.75, 1])
    ax.set_xlabel("firing strength")
    ax.grid(visible=False, axis="y")
    ax.legend(loc="lower right", bbox_to_anchor=(1, 1), ncols=2, fontsize=8)
    return ax


def explorer() -> widgets.VBox:
    """Return the sensors as sliders, a choice of faults that sets them, and the diagnosis.

    Returns
    -------
    ipywidgets.VBox
        To be shown as the last value of a notebook's cell.

    Examples
    --------
    >>> controls, verdict, image = explorer().children
    >>> "normal" in verdict.value
    True
    """
    wide = {"style": {"description_width": "11em"}, "layout": {"width": "30em"}}
    start = Inputs()
    labels = {
        "FP": "pump pressure FP [bar]", "OP": "operating press. OP [bar]",
        "MC": "motor current MC [A]", "OT": "motor temp. OT [degC]", "VPos": "position VPos [%]",
        "DVPos": "speed DVPos [%/s]",
    }  # fmt: skip
    sensors: dict[str, widgets.Widget] = {
        v.name: widgets.FloatSlider(
            getattr(start, v.name), min=v.low, max=v.high, step=0.05, description=labels[v.name],
            **wide,
        )
        for v in _base().variables
    }  # fmt: skip
    sensors["commanded"] = widgets.Checkbox(True, description="a command is active", **wide)
    sensors["cut"] = widgets.FloatSlider(0.5, min=0.05, max=1, step=0.05, description="cut", **wide)
    plant = {
        "fault": widgets.Dropdown(options=[NORMAL, *FAULTS], description="fault", **wide),
        "severity": widgets.FloatSlider(
            1.0, min=0, max=1, step=0.01, description="its severity", **wide
        ),
        "state": widgets.Dropdown(options=list(STATES), description="the valve is", **wide),
    }
    board, quiet = Board(), [False]

    def show(_: object = None) -> None:
        if quiet[0]:
            return
        result = update(Inputs(**{name: control.value for name, control in sensors.items()}))
        text = result.headline
        if text in result.decision.firing.base.codes:
            text = f"{text}: {result.decision.firing.base.rule(text).english}"
        colour = GOOD if result.headline == NORMAL else BAD
        board.show(text, colour, result.numbers, lambda ax: draw(result, ax=ax), 3.6)

    def set_sensors(_: object = None) -> None:
        """Show once all sensors are set, not after each."""
        read = from_plant(**{name: control.value for name, control in plant.items()})
        quiet[0] = True
        try:
            for name, control in sensors.items():
                if name != "cut":
                    control.value = getattr(read, name)
        finally:
            quiet[0] = False
        show()

    for control in sensors.values():
        control.observe(show, "value")
    for control in plant.values():
        control.observe(set_sensors, "value")
    show()
    columns = widgets.HBox(
        [widgets.VBox([*plant.values(), sensors["commanded"], sensors["cut"]]),
         widgets.VBox([sensors[v.name] for v in _base().variables])]
    )  # fmt: skip
    return widgets.VBox([columns, *board.parts])
