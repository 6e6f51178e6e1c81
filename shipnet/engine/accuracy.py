"""How finely an input card resolves each range, and how wrong a value may be at most."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from shipnet.engine.converters import InputCard, kinds

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["accuracy_table"]


def accuracy_table(card: InputCard) -> pd.DataFrame:
    """Return resolution and largest error of each kind of analogue input.

    Parameters
    ----------
    card : InputCard
        Points and their converters.

    Returns
    -------
    pandas.DataFrame
        One row a kind of input: ``condition``, ``low``, ``high``, ``unit``, ``points`` (how many
        of it), ``codes`` (how many occur within the range), ``step_low`` and ``step_high`` (from
        one code to the next at both ends), ``largest_error`` within the range and ``error_at``,
        the value there; the last five but the number in the unit of the range.

    Notes
    -----
    Quantisation, and the firmware's straight line if the card has one; sensors, amplifiers and
    reference count as perfect. Between two steps of the converter the decoded value stands still,
    so the largest error lies at a step or an end of the range: the table looks at all of these.
    Without margin the highest code begins one and a half steps below full scale and the error
    there is a whole step, twice that of anywhere else.

    Examples
    --------
    >>> from shipnet.engine.points import load_points
    >>> table = accuracy_table(InputCard(load_points()))
    >>> loops = table[table.condition == "4-20 mA"]
    >>> loops[["low", "high", "step_low", "largest_error"]].round(3).values.tolist()[:2]
    [[-50.0, 600.0, 0.635, 0.635], [0.0, 4.0, 0.004, 0.004]]
    """
    import pandas as pd

    rows = []
    for k, count in kinds(card.points):
        point = card.points[k]
        if not point.analogue:
            continue
        one = InputCard((point,), card.adc, card.margin, card.linearised)
        n = card.adc.highest + 1
        # Values at which the code changes, and those that the codes stand for.
        edges = one.decoded((np.arange(1, n) - 0.5)[:, np.newaxis] / n, linearised=True)[:, 0]
        decoded = one.value(np.arange(n)[:, np.newaxis])[:, 0]
        inside = (edges > point.low) & (edges < point.high)
        first, last = (int(one.code(one.signal([end]))[0]) for end in (point.low, point.high))
        ends = np.concatenate([[point.low], np.repeat(edges[inside], 2), [point.high]])
        below = np.flatnonzero(inside)
        pairs = np.column_stack([below, below + 1]).ravel()
        codes = np.concatenate([[first], pairs, [last]])
        errors = np.abs(decoded[codes] - ends)
        # Of equal errors the one at the highest value is named, whatever rounding makes of them.
        worst = int(np.flatnonzero(errors >= errors.max() * (1 - 1e-9))[-1])
        rows.append(
            (
                point.condition,
                point.low,
                point.high,
                point.unit,
                count,
                last - first + 1,
                decoded[first + 1] - decoded[first],
                decoded[last] - decoded[last - 1],
                errors[worst],
                ends[worst],
            )
        )
    columns = ["condition", "low", "high", "unit", "points", "codes", "step_low", "step_high",
               "largest_error", "error_at"]  # fmt: skip
    return pd.DataFrame(rows, columns=columns)
