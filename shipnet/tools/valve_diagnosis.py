"""The diagnosis explorer: the sensors of a valve, and the rules that fire."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from math import isnan
from typing import Any, ClassVar

from matplotlib.axes import Axes

from shipnet import style
from shipnet.ballast.plant import FAULTS, Command, Fault
from shipnet.ballast.rule_table import rule_base
from shipnet.ballast.scan import System
from shipnet.ballast.sensors import Sensors
from shipnet.ballast.simulation import simulate_valves
from shipnet.fields import check_choice, check_scalar, choice, number, record, switch
from shipnet.fuzzy.rules import Decision, RuleBase
from shipnet.fuzzy.terms import NORMAL
from shipnet.lazy import pd
from shipnet.tools._tool import Tool
from shipnet.tools._view import Measure, Preset, View, words

_WORDS = words("valve_diagnosis")

#: States of a valve: initial opening (0..1), command, and time of the reading [s].
STATES: dict[str, tuple[float, str | None, float]] = {
    "opening": (0.5, "open", 4.0),
    "closing": (0.5, "close", 4.0),
    "at rest, open": (1.0, None, 1.0),
    "at rest, closed": (0.0, None, 1.0),
}

_BASE: RuleBase = rule_base()


def _sensor(name: str, default: float) -> Any:
    one = _BASE[name]
    return number(
        one.low, one.high, one.unit, _WORDS[name], default=default, step=0.05, missing=True
    )


@record
class ValveDiagnosis(Tool):
    """The diagnosis of a valve's readings by the rules of kim2014.

    `result` is the decision, a `fuzzy.Decision`; `strength` has the firing strength of each rule,
    and `printed` the codes that fire at the printed limits.

    Examples
    --------
    >>> ValveDiagnosis().verdict
    'normal'
    >>> stuck = ValveDiagnosis.from_plant("V1")
    >>> round(stuck.FP), round(stuck.OP), stuck.DVPos
    (128, 10, 0.0)
    """

    #: The states of a valve that `from_plant` can simulate.
    STATES: ClassVar[Mapping[str, Any]] = STATES

    FP: float = _sensor("FP", 90.0)
    OP: float = _sensor("OP", 2.0)
    MC: float = _sensor("MC", 1.2)
    OT: float = _sensor("OT", 50.0)
    VPos: float = _sensor("VPos", 50.0)
    DVPos: float = _sensor("DVPos", 11.0)
    commanded: bool = switch(_WORDS["commanded"], default=True)
    threshold: float = number(0.05, 1.0, help=_WORDS["threshold"], default=0.5, step=0.05)

    @property
    def readings(self) -> dict[str, list[float]]:
        """The readings for the rules."""
        return {name: [getattr(self, name)] for name in _BASE.names}

    @property
    def applies(self) -> dict[str, bool]:
        """Whether the speed applies: only while a command is active."""
        return {"DVPos": self.commanded}

    @cached_property
    def result(self) -> Decision:
        """The decision of the rules."""
        return _BASE.decide(self.readings, threshold=self.threshold, applies=self.applies)

    @property
    def strength(self) -> dict[str, float]:
        """Firing strength by code, highest priority first."""
        firing = self.result.firing
        return {code: float(firing[code][0]) for code in _BASE.ranking}

    @cached_property
    def printed(self) -> tuple[str, ...]:
        """Codes that fire at the limits printed in the paper, without ramps."""
        return _BASE.decide(self.readings, "crisp", applies=self.applies).codes(0)

    @style.applied
    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the firing strength of every rule as a bar."""
        ax, strength, active = style.axes(ax), self.strength, self.result.codes(0)
        codes = list(strength)
        colours = ["C1" if code in active else "C0" for code in codes]
        ax.barh(range(len(codes)), list(strength.values()), color=colours, height=0.7)
        labels = [f"{code}  {_BASE.rule(code).english}" for code in codes]
        ax.set_yticks(range(len(codes)), labels)
        look: dict[str, Any] = dict(style.LIMIT)
        ax.axvline(self.threshold, label="alarm threshold", **look)
        y = [codes.index(code) for code in self.printed]
        # Beside the axes, because a rule as printed has no strength.
        look = {"color": "0.2", "markersize": 6, "clip_on": False}
        ax.plot(
            [1.03] * len(y),
            y,
            "x",
            label="fires as printed",
            transform=ax.get_yaxis_transform(),
            **look,
        )
        ax.set(xlim=(0, 1), ylim=(len(codes) - 0.4, -0.6), xlabel="firing strength")
        ax.set_xticks([0, 0.25, 0.5, 0.75, 1])
        ax.grid(visible=False, axis="y")
        ax.legend(loc="lower right", bbox_to_anchor=(1, 1), ncols=2)
        return ax

    @classmethod
    def from_plant(
        cls,
        fault: str = NORMAL,
        severity: float = 1.0,
        state: str = "opening",
        *,
        threshold: float = 0.5,
    ) -> ValveDiagnosis:
        """Return the diagnosis of a simulated valve from its readings without noise.

        `fault` is a code of the rule table or ``"normal"``, `severity` 0..1, and `state` one of
        `STATES`; a moving valve starts half open and is read after 4 s.
        """
        start, order, duration = STATES[check_choice("state", state, STATES)]
        check_choice("fault", fault, (NORMAL, *FAULTS))
        degree = check_scalar("severity", severity, "", 0, 1)
        faults = [] if fault == NORMAL else [Fault(fault, degree)]
        orders = [] if order is None else [Command(order)]
        quiet = Sensors(noise=(0.0,) * 5, bits=None)
        system = System(sensors=quiet, opening=start, step=0.5)
        run = simulate_valves(system, orders, faults, duration)
        last = {name: round(float(values[-1, 0]), 6) for name, values in run.samples.items()}
        commanded = bool(run.active[-1, 0])
        if not commanded:
            last["DVPos"] = 0.0
        return cls(**last, commanded=commanded, threshold=threshold)

    def _in_terms(self) -> str:
        """Return the term of each reading and its membership, which a rule may need with others."""
        words = []
        for variable in _BASE.variables:
            x = getattr(self, variable.name)
            degrees = [(term.english or term.name, term.membership(x)) for term in variable.terms]
            terms = " and ".join(f"{name} {degree:.2f}" for name, degree in degrees if degree > 0)
            if not self.applies.get(variable.name, True):
                terms = "not used"
            elif isnan(x):
                terms = "missing"
            words.append(f"{variable.name} {terms or 'in no term'}")
        return ", ".join(words)

    def _view(self) -> View:
        top, codes = str(self.result.top[0]), list(self.strength)

        def rules() -> pd.DataFrame:
            printed = [code in self.printed for code in codes]
            columns = {"strength": self.strength.values(), "as_printed": printed}
            return pd.DataFrame(columns, pd.Index(codes, name="code"))

        return View(
            verdict=f"{top}: {_BASE.rule(top).english}" if top in _BASE.codes else top,
            ok=top == NORMAL,
            numbers={
                "why": self.result.explain(0),
                "readings": self._in_terms(),
                "active codes": " ".join(self.result.codes(0)) or "none",
                "as printed, without ramps": " ".join(self.printed) or "none",
            },
            plot=self.plot,
            about="Firing strength of each rule as a bar, with the alarm threshold",
            curve=lambda: rules()["strength"],
            data=rules,
            short=top,
            measure=Measure(
                "strength", "highest strength", max(self.strength.values()), self.threshold
            ),
            idle={} if self.commanded else {"DVPos": "it counts only while a command is active"},
        )

    def _options(self) -> dict[str, Any]:
        def make(plant: _Plant, inputs: ValveDiagnosis) -> ValveDiagnosis:
            return ValveDiagnosis.from_plant(
                plant.fault, plant.severity, plant.state, threshold=inputs.threshold
            )

        def idle(plant: _Plant) -> dict[str, str]:
            return {"severity": "no fault is chosen"} if plant.fault == NORMAL else {}

        return {"preset": Preset(_Plant(), make, idle)}


@record
class _Plant:
    """The simulated valve that sets the readings."""

    fault: str = choice([NORMAL, *FAULTS], _WORDS["fault"], default=NORMAL)
    severity: float = number(0, 1, help=_WORDS["severity"], default=1.0, step=0.01)
    state: str = choice(list(STATES), _WORDS["state"], default="opening")
