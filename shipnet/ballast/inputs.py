"""What the rules are given at each instant, and what of it reaches into the block that follows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from shipnet.ballast.features import running_time
from shipnet.ballast.simulation import Run
from shipnet.ballast.speed import WINDOW, position_speed
from shipnet.errors import ArgumentError
from shipnet.fuzzy.rules import RuleBase

__all__ = ["Tail", "rule_inputs"]

Floats = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Tail:
    """The end of a run, for the diagnosis of the run that follows it.

    Parameters
    ----------
    time : ndarray of float, shape (n_kept,)
        Last instants [s].
    samples : dict of str to ndarray, shape (n_kept, n_valves)
        What the rules were given then.
    active_before : ndarray of bool, shape (n_valves, n_rules)
        What was active before the run.
    active : ndarray of bool, shape (n_valves, n_rules)
        What is active at its last instant.
    started : ndarray of float, shape (n_valves,)
        When the motors that still run were started [s]; NaN for the others.
    """

    time: Floats
    samples: dict[str, Floats]
    active_before: Flags
    active: Flags
    started: Floats

    @classmethod
    def keep(
        cls,
        run: Run,
        time: Floats,
        samples: dict[str, Floats],
        active: Flags,
        window: int,
        earlier: Tail | None,
    ) -> Tail:
        """Copy what the next block needs, so that it does not keep this one in memory.

        Parameters
        ----------
        run : Run
            What was read.
        time : ndarray of float, shape (n,)
            Instants of the tail before it and of the run [s].
        samples : dict of str to ndarray, shape (n, n_valves)
            What `rule_inputs` returned.
        active : ndarray of bool, shape (n_times, n_valves, n_rules)
            Active codes of the run.
        window : int
            Instants that a code is judged by.
        earlier : Tail or None
            That of the block before.

        Returns
        -------
        Tail
            The end of the run.
        """
        before = np.zeros(active.shape[1:], bool) if earlier is None else earlier.active
        last = active[-1].copy() if len(active) else before
        then = int(np.searchsorted(time, time[-1] - WINDOW + 1e-9)) - 1 if time.size else 0
        keep = slice(max(min(then, time.size - window + 1), 0), None)
        started = np.full(run.n_valves, np.nan)
        if "Time" in samples and time.size:
            started = time[-1] - samples["Time"][-1]
            for moved in run.movements:
                if moved.end > time[-1]:
                    started[moved.valve] = np.nan
        kept = {name: x[keep].copy() for name, x in samples.items()}
        return cls(time[keep].copy(), kept, before, last, started)


def rule_inputs(
    run: Run, base: RuleBase, earlier: Tail | None = None, *, any_time: bool = False
) -> dict[str, Floats]:
    """Return the channels that rules speak of, those of the tail before them.

    Parameters
    ----------
    run : Run
        What was read.
    base : RuleBase
        The rules.
    earlier : Tail, optional
        That of the block before.
    any_time : bool, default False
        DVPos is the change of VPos over a second at any time, else it counts while a command is
        active and the motor has been running for so long.

    Returns
    -------
    dict of str to ndarray, shape (n, n_valves)
        By variable, VPos always among them; NaN where it does not count.

    Raises
    ------
    ArgumentError
        If the rules speak of something else.

    Examples
    --------
    >>> from shipnet.ballast import simulate
    >>> from shipnet.ballast.rule_table import rule_base
    >>> rules, run = rule_base(), simulate(duration=2, step=1)
    >>> [rule_inputs(run, rules, any_time=x)["DVPos"][:, 0].tolist() for x in (False, True)]
    [[nan, nan, nan], [nan, 0.0, 0.0]]
    """
    found = dict(run.samples)
    if "Time" in base.names:
        found["Time"] = running_time(run, np.nan if earlier is None else earlier.started)
    strange = [name for name in base.names if name not in found]
    if strange:
        raise ArgumentError(f"rules speak of {', '.join(strange)}; a run has {', '.join(found)}")
    found["DVPos"] = np.where(run.active, run.DVPos, np.nan)
    # The change of VPos needs it, whether the rules speak of it or not.
    found = {name: found[name] for name in dict.fromkeys((*base.names, "VPos"))}
    if earlier is not None:
        found = {name: np.concatenate([earlier.samples[name], x]) for name, x in found.items()}
    if any_time and "DVPos" in found:
        kept = 0 if earlier is None else earlier.time.size
        time = run.time if earlier is None else np.concatenate([earlier.time, run.time])
        found["DVPos"][kept:] = position_speed(time, found["VPos"])[kept:]
    return found
