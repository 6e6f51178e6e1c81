"""The diagnosis explorer: the sensors of a valve, and the rules that fire."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property, lru_cache
from math import isnan
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from matplotlib.axes import Axes

from shipnet import style
from shipnet.ballast.log_file import read_log
from shipnet.ballast.plant import FAULTS, Command, Fault
from shipnet.ballast.rule_table import rule_base
from shipnet.ballast.scan import System
from shipnet.ballast.sensors import Sensors
from shipnet.ballast.simulation import simulate_valves
from shipnet.fields import check_choice, check_scalar, choice, number, record, switch, text
from shipnet.files import as_file
from shipnet.fuzzy.rules import Decision, RuleBase
from shipnet.fuzzy.terms import NORMAL
from shipnet.lazy import pd
from shipnet.tables import as_csv, text_of
from shipnet.tools._tool import Tool
from shipnet.tools._view import Loaded, Measure, Preset, Upload, View, words

_WORDS = words("valve_diagnosis")

#: States of a valve: initial opening (0..1), command, and time of the reading [s].
STATES: dict[str, tuple[float, str | None, float]] = {
    "opening": (0.5, "open", 4.0),
    "closing": (0.5, "close", 4.0),
    "at rest, open": (1.0, None, 1.0),
    "at rest, closed": (0.0, None, 1.0),
}

_BASE: RuleBase = rule_base()

#: Maximum number of diagnoses of a log that are explained.
_EXPLAINED = 8


def _sensor(name: str, default: float) -> Any:
    one = _BASE[name]
    return number(
        one.low, one.high, one.unit, _WORDS[name], default=default, step=0.05, missing=True
    )


@record
class ValveDiagnosis(Tool):
    """The diagnosis of a valve's readings by the rules of kim2014.

    `result` is the decision, a `fuzzy.Decision`; `strength` has the firing strength of each rule,
    and `printed` the codes that fire at the printed limits. A `log`, as text, takes the place of
    the readings; a code is then active if its rule fired in three of the last five samples.

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
    log: str = text(_WORDS["log"], default="", most=1_000_000, rows=6, hint="time_s,FP,OP,MC,OT")

    @property
    def readings(self) -> Any:
        """The readings for the rules, one per sample."""
        if self.log:
            return _samples(self.log)
        return {name: [getattr(self, name)] for name in _BASE.names}

    @property
    def applies(self) -> dict[str, bool]:
        """Whether the speed applies: only while a command is active."""
        return {"DVPos": self.commanded}

    @cached_property
    def result(self) -> Decision:
        """The decision of the rules."""
        if self.log:
            return _BASE.decide(self.readings, threshold=self.threshold, k=3, n=5)
        return _BASE.decide(self.readings, threshold=self.threshold, applies=self.applies)

    @property
    def strength(self) -> dict[str, float]:
        """Highest firing strength by code, highest priority first."""
        firing = self.result.firing
        return {code: float(np.fmax.reduce(firing[code])) for code in _BASE.ranking}

    @cached_property
    def printed(self) -> tuple[str, ...]:
        """Codes that fire at the limits printed in the paper, without ramps."""
        return _BASE.decide(self.readings, "crisp", applies=self.applies).codes(0)

    @style.applied
    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the firing strength of every rule as a bar, or that of a log over time."""
        ax, strength, active = style.axes(ax), self.strength, self.result.codes(0)
        codes = list(strength)
        labels = [f"{code}  {_BASE.rule(code).english}" for code in codes]
        if self.log:
            return self._plot_log(ax, labels)
        colours = [style.FIELD["information" if code in active else "address"] for code in codes]
        ax.barh(range(len(codes)), list(strength.values()), color=colours, height=0.7)
        ax.set_yticks(range(len(codes)), labels)
        red = style.LIMIT["color"]
        ax.axvline(self.threshold, color=red, linestyle=style.LIMIT["linestyle"])
        ax.text(self.threshold, -0.7, "alarm\nthreshold", color=red, ha="right", va="bottom")
        # Beside the axes, because a rule as printed has no strength.
        ax.text(1.02, -0.7, "fires as\nprinted", va="bottom")
        for row, code in enumerate(codes):
            ax.text(1.02, row, "yes" if code in self.printed else "no", va="center")
        ax.set(xlim=(0, 1), ylim=(len(codes) - 0.4, -0.6), xlabel="firing strength")
        ax.set_xticks([0, 0.5, 1])
        ax.grid(visible=False, axis="y")
        return ax

    def _plot_log(self, ax: Axes, labels: list[str]) -> Axes:
        """Draw the firing strength of every rule over time as a shade, and where it is active."""
        times = self.readings.index.to_numpy()
        ends = np.append(times[1:], times[-1] + (times[-1] - times[-2] if len(times) > 1 else 1))
        codes, firing = _BASE.ranking, self.result.firing
        shades = ax.pcolormesh(
            [*times, ends[-1]],
            np.arange(len(codes) + 1) - 0.5,
            [firing[code] for code in codes],
            cmap="Blues",
            vmin=0,
            vmax=1,
        )
        for row, code in enumerate(codes):
            active = self.result.active[:, _BASE.codes.index(code)]
            label = "" if row else "active"
            ax.hlines([row] * active.sum(), times[active], ends[active], "C1", lw=5, label=label)
        for strength in (0.5, 1.0):  # a colour bar would take room from the axes
            ax.fill_between([], [], color=shades.cmap(strength), label=f"strength {strength:g}")
        style.legend(ax)
        ax.set_yticks(range(len(codes)), labels)
        ax.set(ylim=(len(codes) - 0.5, -0.5), xlim=(times[0], ends[-1]), xlabel="time [s]")
        ax.grid(visible=False)
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
        last: Any = {name: round(float(values[-1, 0]), 6) for name, values in run.samples.items()}
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

    def _plot_codes(self, ax: Axes) -> None:
        self.plot(ax).set_yticks(range(len(self.strength)), list(self.strength))

    def _log_view(self) -> View:
        """Return the view on a log."""
        top, times = pd.Series(self.result.top), self.readings.index
        starts = np.flatnonzero(top != top.shift()).tolist()
        spans = zip(starts, [*(start - 1 for start in starts[1:]), len(top) - 1], strict=True)
        faults = [(first, last) for first, last in spans if top[first] != NORMAL]
        numbers = {
            f"{times[first]:g} to {times[last]:g} s": self.result.explain(first)
            for first, last in faults[:_EXPLAINED]
        }
        if len(faults) > _EXPLAINED:
            numbers["later"] = f"{len(faults) - _EXPLAINED} more diagnoses; they are in the data"
        counts = top[top != NORMAL].value_counts()
        parts = [f"{code} in {count}" for code, count in counts.items()]
        return View(
            verdict=f"{', '.join(parts) or NORMAL + ' in all'} of {len(top)} samples",
            ok=not parts,
            numbers=numbers,
            plot=self.plot,
            narrow=self._plot_codes,
            about="Firing strength of each rule over time; active rules are orange",
            data=lambda: self.result.table().set_index(times),
            measure=self._measure,
            idle=dict.fromkeys([*_BASE.names, "commanded"], "the log has the readings"),
            short=str(top[faults[0][0]]) if faults else NORMAL,
        )

    @property
    def _measure(self) -> Measure:
        highest = max(self.strength.values())
        return Measure("strength", "highest strength", highest, self.threshold)

    def _view(self) -> View:
        if self.log:
            return self._log_view()
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
            narrow=self._plot_codes,
            about="Firing strength of each rule as a bar, with the alarm threshold",
            curve=lambda: rules()["strength"],
            data=rules,
            short=top,
            measure=self._measure,
            idle={} if self.commanded else {"DVPos": "it counts only while a command is active"},
        )

    def _options(self) -> dict[str, Any]:
        def make(plant: _Plant, inputs: ValveDiagnosis) -> ValveDiagnosis:
            return ValveDiagnosis.from_plant(
                plant.fault, plant.severity, plant.state, threshold=inputs.threshold
            )

        def idle(plant: _Plant) -> dict[str, str]:
            return {"severity": "no fault is chosen"} if plant.fault == NORMAL else {}

        tip = "A log of one valve as CSV or Excel, with columns such as FP."
        return {
            "preset": Preset(_Plant(), make, idle),
            "uploads": [Upload("open a log", tip, ".csv,.txt,.xlsx", _open_log)],
            "folds": {"valve log": ("log",)},
        }


def _open_log(inputs: ValveDiagnosis, name: str, content: bytes) -> Loaded:
    """Return the inputs with the readings of a file, and what was not used or is missing."""
    with as_file(name, content, f"file{Path(name).suffix}") as path:
        log = read_log(path)
    text = text_of(as_csv(log.round(6).reset_index()))
    return Loaded(replace(inputs, log=text), [str(one) for one in log.attrs["remarks"]])


@lru_cache(maxsize=8)
def _samples(text: str) -> pd.DataFrame:
    with as_file("the log", text.encode()) as path:
        return read_log(path)


@record
class _Plant:
    """The simulated valve that sets the readings."""

    fault: str = choice([NORMAL, *FAULTS], _WORDS["fault"], default=NORMAL)
    severity: float = number(0, 1, help=_WORDS["severity"], default=1.0, step=0.01)
    state: str = choice(list(STATES), _WORDS["state"], default="opening")
