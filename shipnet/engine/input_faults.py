"""What a junction box sees of a sensor whose wires are broken or touch each other."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np

from shipnet.engine.converters import InputCard, kinds
from shipnet.errors import ArgumentError

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["FAULTS", "fault_signals", "input_fault_table"]

Fault = Literal["open", "short"]

#: Signal of each kind of sensor by fault: resistance [ohm], current [A], contact (1 is closed).
#: A short circuit across a transmitter leaves the supply to the 250 ohm alone; with 24 V these
#: take 96 mA, beyond every window.
FAULTS: dict[Fault, dict[str, float]] = {
    "open": {"RTD": np.inf, "4-20 mA": 0.0, "switch": 0.0},
    "short": {"RTD": 0.0, "4-20 mA": np.inf, "switch": 1.0},
}


def fault_signals(card: InputCard, fault: Fault) -> list[float]:
    """Return the signals of all points with the same fault.

    Parameters
    ----------
    card : InputCard
        Points and their converters.
    fault : {"open", "short"}
        Broken wire, or short circuit across the sensor.

    Returns
    -------
    list of float
        Signals for `InputCard.code`.

    Raises
    ------
    ArgumentError
        If there is no such fault.

    Examples
    --------
    >>> from shipnet.engine.points import load_points
    >>> card = InputCard(load_points()[20:21])
    >>> card.value(card.code(fault_signals(card, "open"))).tolist()
    [-50.0]
    """
    if fault not in FAULTS:
        raise ArgumentError(f"fault is {fault!r}; it must be open or short")
    return [FAULTS[fault][point.condition] for point in card.points]


def input_fault_table(card: InputCard) -> pd.DataFrame:
    """Return what the box makes of a broken wire and of a short circuit, by kind of input.

    Parameters
    ----------
    card : InputCard
        Points and their converters.

    Returns
    -------
    pandas.DataFrame
        Two rows a kind of input: ``condition``, ``low``, ``high``, ``unit``, ``points`` (how many
        of it), ``fault``, ``code`` that the converter gives, ``reads`` (the value that stands for
        it), ``legal`` (whether a healthy sensor within its range gives this code too) and
        ``told``, whether the limits of the card tell it from a value.

    Notes
    -----
    Without margin the amplifier takes the live zero of 4-20 mA away: 4 mA and a broken wire are
    both 0 V. A switch that opens on alarm shows a broken wire as an alarm, which is safe, and
    hides every later alarm if its wires touch.

    Examples
    --------
    >>> from shipnet.engine.points import load_points
    >>> points = load_points()
    >>> printed, mended = (input_fault_table(InputCard(points, margin=m)) for m in (0, 0.125))
    >>> loop = printed[(printed.condition == "4-20 mA") & (printed.fault == "open")].iloc[0]
    >>> print(*loop[["code", "reads", "legal", "told"]])
    0 -50.0 True False
    >>> bool(mended[mended.condition != "switch"].told.all())
    True
    """
    import pandas as pd

    low, high = (
        card.code(card.signal([getattr(point, end) for point in card.points])).astype(int)
        for end in ("low", "high")
    )
    rows = []
    codes = {fault: card.code(fault_signals(card, fault)) for fault in FAULTS}
    values = {fault: card.value(code) for fault, code in codes.items()}
    told = {fault: ~card.valid(code) for fault, code in codes.items()}
    for k, count in kinds(card.points):
        point = card.points[k]
        for fault in FAULTS:
            code = int(codes[fault][k])
            legal = min(low[k], high[k]) <= code <= max(low[k], high[k])
            rows.append(
                (
                    point.condition,
                    point.low,
                    point.high,
                    point.unit,
                    count,
                    fault,
                    code,
                    float(values[fault][k]),
                    bool(legal),
                    bool(told[fault][k]),
                )
            )
    columns = ["condition", "low", "high", "unit", "points", "fault", "code", "reads", "legal",
               "told"]  # fmt: skip
    return pd.DataFrame(rows, columns=columns)
