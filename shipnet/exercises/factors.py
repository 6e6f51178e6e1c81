"""What a wrong number may come from, judged by its ratio to the right one."""

from __future__ import annotations

from math import isclose

__all__ = ["factor_hint"]

#: Powers of ten that prefixes of units make: from pico to tera, one way or the other.
_PREFIXES = tuple(power for power in range(-24, 25, 3) if power)

#: Units of time: what bits take, so that bytes in their place make a factor of 8.
_TIMES = ("ns", "us", "ms", "s")


def factor_hint(number: float, right: float, unit: str, tolerance: float) -> str | None:
    """Return which typical mistake explains a wrong number.

    Parameters
    ----------
    number : float
        The wrong answer.
    right : float
        The right one.
    unit : str
        Unit in which it is asked for.
    tolerance : float
        Relative tolerance, for the digits to be called right [1].

    Returns
    -------
    str or None
        A hint; None if no typical mistake has this ratio.

    Examples
    --------
    >>> factor_hint(-5, 5, "V", 0.005)
    'the sign is wrong'
    >>> factor_hint(0.3, 30, "%", 0.005)
    'that is the share; asked for is the percentage, 100 times as much'
    """
    if not (number and right):
        return None

    def near(factor: float) -> bool:
        return isclose(number, factor * right, rel_tol=tolerance)

    if near(-1):
        return "the sign is wrong"
    for power in _PREFIXES:
        if near(10.0**power):
            where = f"{10 ** abs(power)} times too {'large' if power > 0 else 'small'}"
            asked = f": is it in {unit}, or in another unit?" if unit else ": which unit is it in?"
            return f"the digits are right, but it is {where}{asked}"
    if unit == "%" and near(0.01):
        return "that is the share; asked for is the percentage, 100 times as much"
    if not unit and near(100):
        return "that is the percentage; asked for is the share, a hundredth of it"
    if isclose(number * right, 1, rel_tol=tolerance) and not isclose(abs(right), 1, rel_tol=0.05):
        return "that is one over the answer: a rate where a time is asked for, or the other way?"
    for power in range(-8, 9):
        if power and near(10.0**power):
            return "the digits are right, but the point is in the wrong place"
    of_bits = unit in _TIMES or "bit" in unit or "byte" in unit
    if of_bits and (near(8) or near(1 / 8)):
        return "a factor of 8: bits or bytes?"
    if near(2):
        return "that is twice as much: is something counted twice?"
    if near(0.5):
        return "that is half of it: is something left out?"
    return None
