"""Numbers as a table of a design shows them: counts whole, estimates with three digits."""

from __future__ import annotations

from math import floor, isinf, isnan, log10

__all__ = ["number"]


def number(value: float) -> str:
    """Return a count as it is, and anything else with three significant digits.

    Parameters
    ----------
    value : float
        Any; NaN is a dash, and infinity has no limit.

    Returns
    -------
    str
        Without an exponent.

    Examples
    --------
    >>> number(1584.0), number(108824.27), number(0.01234), number(float("nan"))
    ('1,584', '109,000', '0.0123', '-')
    """
    if isnan(value):
        return "-"
    if isinf(value):
        return "without limit"
    if value == int(value):
        return f"{value:,.0f}"
    places = 2 - floor(log10(abs(value)))
    return f"{round(float(value), places):,.{max(places, 0)}f}"
