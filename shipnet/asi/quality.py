"""How well telegrams come over: level, evenness, ringing, and whether they are read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.asi.modulation import as_bits
from shipnet.asi.receiver import TOLERANCE, receive
from shipnet.asi.segment import Segment
from shipnet.asi.telegram import RESPONSES
from shipnet.asi.timing import BIT_TIME
from shipnet.errors import ArgumentError

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

    from shipnet.asi.plan import Plan

#: Sampling interval of the waveforms, and the silence behind a telegram [s].
_STEP, _SILENCE = 250e-9, 60e-6

Floats = npt.NDArray[np.float64]


class Quality(NamedTuple):
    """How telegrams come over between a master and each slave: the worst over all of them.

    By reciprocity a slave hears of the master what the master hears of it, if both send with the
    same current, so it serves both directions. The send current does not depend on the voltage
    here; a real sender may clip.

    Attributes
    ----------
    level_least, level_most : ndarray of float, shape (n_slaves,)
        Signal, peak to peak [V].
    evenness : ndarray of float, shape (n_slaves,)
        Smallest pulse over largest pulse of a telegram, 0..1; 0 if none is received.
    ringing : ndarray of float, shape (n_slaves,)
        Largest voltage without a pulse over largest pulse; 1 if none is received.
    received : ndarray of float, shape (n_slaves,)
        Share of the telegrams that are received as they were sent, 0..1.
    slaves : tuple of str
        The slaves.

    Examples
    --------
    >>> from shipnet.asi.topologies import line
    >>> quality = line(100, slaves=(5, 100)).quality()
    >>> quality.table()[["level_least_Vpp", "evenness", "ringing"]].round(2).values.tolist()
    [[4.85, 0.96, 0.09], [6.48, 0.95, 0.06]]
    """

    level_least: Floats
    level_most: Floats
    evenness: Floats
    ringing: Floats
    received: Floats
    slaves: tuple[str, ...] = ()

    def __repr__(self) -> str:
        """Sum up all slaves in one line."""
        good = f"{int(self.within_tolerance.sum())} of {len(self.received)} slaves"
        worst = f"evenness from {self.evenness.min():.2f}, ringing up to {self.ringing.max():.2f}"
        return f"Quality({good} within tolerance; {worst})"

    def table(self) -> pd.DataFrame:
        """Return one row per slave, as a table."""
        import pandas as pd

        columns = ["level_least_Vpp", "level_most_Vpp", "evenness", "ringing", "received"]
        index = pd.Index(self.slaves or range(1, len(self.received) + 1), name="slave")
        return pd.DataFrame(dict(zip(columns, self[:5], strict=True)), index=index)

    @property
    def within_tolerance(self) -> npt.NDArray[np.bool_]:
        """Which slaves have pulses as even and gaps as still as they should be."""
        return np.asarray(
            (self.evenness >= TOLERANCE.evenness) & (self.ringing <= TOLERANCE.ringing)
        )

    def worst(self, other: Quality) -> Quality:
        """Return the worse of this and another quality of the same slaves; `received` is left."""
        return self._replace(
            level_least=np.minimum(self.level_least, other.level_least),
            level_most=np.maximum(self.level_most, other.level_most),
            evenness=np.minimum(self.evenness, other.evenness),
            ringing=np.maximum(self.ringing, other.ringing),
        )

    def of(self, rows: Sequence[int], slaves: tuple[str, ...]) -> Quality:
        """Return some of the entries, some of them perhaps twice, under other names."""
        some = list(rows)
        return Quality(
            self.level_least[some], self.level_most[some], self.evenness[some],
            self.ringing[some], self.received[some], slaves,
        )  # fmt: skip


def signal_quality(segment: Segment, words: Sequence[str] = RESPONSES) -> Quality:
    """Return how telegrams come over between the master and each slave of a segment."""
    bits = as_bits(words)
    n_bits = bits.shape[-1]
    duration = n_bits * BIT_TIME + _SILENCE
    _, u = segment.signals(bits, dt=_STEP, duration=duration)
    heard = receive(u, _STEP, n_bits)
    right = (heard.error == 0) & (heard.bits == bits).all(axis=-1)
    level = np.ptp(u, axis=-1)
    return Quality(
        level.min(axis=1),
        level.max(axis=1),
        np.nan_to_num(heard.weakest, nan=0.0).min(axis=1),
        np.nan_to_num(heard.ringing, nan=1.0).max(axis=1),
        right.mean(axis=1),
        segment.slaves,
    )


class Comparison:
    """Qualities of several plans, by name."""

    def __init__(self, qualities: Mapping[Any, Quality]) -> None:
        self.qualities = dict(qualities)

    def __repr__(self) -> str:
        """Count the plans and those within tolerance."""
        good = int(self.within_tolerance.sum())
        return f"<Comparison: {len(self.qualities)} plans, {good} within tolerance>"

    def table(self, *, by_slave: bool = False) -> pd.DataFrame:
        """Return the worst slave of each plan, one row per plan, or one row per slave of each."""
        import pandas as pd

        if by_slave:
            parts = {name: one.table() for name, one in self.qualities.items()}
            return pd.DataFrame(pd.concat(parts, names=["plan"]))
        rows = {
            name: (
                len(q.received), q.received.min(), q.level_least.min(), q.evenness.min(),
                q.ringing.max(),
            )
            for name, q in self.qualities.items()
        }  # fmt: skip
        columns = ["slaves", "received", "level_least_Vpp", "evenness", "ringing"]
        table = pd.DataFrame.from_dict(rows, orient="index", columns=columns)
        return table.rename_axis("plan")

    @property
    def within_tolerance(self) -> npt.NDArray[np.bool_]:
        """Which plans keep all their slaves within both tolerances."""
        return np.array([bool(one.within_tolerance.all()) for one in self.qualities.values()])

    def plot(self, ax: Axes | None = None, *, label: str = "", **line: Any) -> Axes:
        """Draw weakest pulse and ringing over the names, if these are numbers, or the order."""
        from shipnet.asi.plot import plot_comparison

        names = list(self.qualities)
        numbers = all(isinstance(name, int | float | np.number) for name in names)
        x = names if numbers else range(1, len(names) + 1)
        return plot_comparison(x, self.table(), ax=ax, label=label, **line)


def compare(plans: Mapping[Any, Plan]) -> Comparison:
    """Compare how the responses of slaves come over in several plans.

    Parameters
    ----------
    plans : mapping of str or float to Plan
        The plans, each of one segment, by name or by what differs, such as the length [m].

    Returns
    -------
    Comparison
        It has ``table(by_slave=False)``, ``within_tolerance`` and ``plot(ax)``.

    Raises
    ------
    ArgumentError
        If there is no plan.

    Examples
    --------
    >>> from shipnet.asi.topologies import line
    >>> lengths = compare({m: line(m, slaves=(5, m)) for m in (50, 100, 200)})
    >>> lengths.table()["evenness"].round(2).to_dict()
    {50: 0.91, 100: 0.95, 200: 0.36}
    >>> lengths.within_tolerance.tolist()
    [True, True, False]
    """
    if not plans:
        raise ArgumentError("plans are empty; there must be at least one")
    return Comparison({name: plan.quality() for name, plan in plans.items()})
