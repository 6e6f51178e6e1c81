"""Fields of a tool's `Inputs`: default, legal range, label and help in one place."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import field, fields
from typing import Any

from shipnet.errors import ArgumentError
from shipnet.tools._kinds import Asked, Choice, Number, Series, Switch, Text, Whole

__all__ = ["asked", "check", "choice", "number", "series", "switch", "text", "whole"]


def _field(default: Any, kind: Asked) -> Any:
    return field(default=default, metadata={"asked": kind})


def _shown(name: str, legal: tuple[Any, Any], slider: tuple[Any, Any] | None) -> tuple[Any, Any]:
    shown = slider or legal
    if not legal[0] <= shown[0] < shown[1] <= legal[1]:
        raise ArgumentError(f"slider of {name!r} is {shown}; it must lie within {legal}")
    return shown


def number(
    default: float,
    low: float,
    high: float,
    *,
    label: str,
    help: str,
    step: float = 1.0,
    unit: str = "",
    slider: tuple[float, float] | None = None,
    missing: bool = False,
) -> Any:
    """Return a dataclass field for a number.

    Parameters
    ----------
    default : float
        Where the slider starts.
    low, high : float
        Legal range, both ends included.
    label, help : str
        As for `Asked`.
    step : float, default 1
        Step of the slider.
    unit : str, optional
        Unit, shown behind the label and in messages.
    slider : tuple of float, optional
        Range of the slider where it is narrower than the legal one.
    missing : bool, default False
        Whether NaN is legal.

    Returns
    -------
    dataclasses.Field
        To be assigned in the body of a dataclass.

    Raises
    ------
    ArgumentError
        If the slider would reach what is not legal.

    Examples
    --------
    >>> number(100.0, 1, 500, label="length", help="", unit="m").metadata["asked"].high
    500
    """
    shown = _shown(label, (low, high), slider)
    kind = Number(
        label=label, help=help, low=low, high=high, step=step, unit=unit, shown=shown,
        missing=missing,
    )  # fmt: skip
    return _field(default, kind)


def whole(
    default: int,
    low: int,
    high: int,
    *,
    label: str,
    help: str,
    unit: str = "",
    slider: tuple[int, int] | None = None,
    at_most: str = "",
    typed: bool = False,
) -> Any:
    """Return a dataclass field for a whole number.

    Parameters
    ----------
    default, low, high, label, help, unit, slider
        As for `number`.
    at_most : str, optional
        Field before this one whose value this one must not exceed.
    typed : bool, default False
        Whether it is typed into a box, and not set by a slider.

    Returns
    -------
    dataclasses.Field
        To be assigned in the body of a dataclass.

    Raises
    ------
    ArgumentError
        If the slider would reach what is not legal.

    Examples
    --------
    >>> whole(6, 0, 15, label="data", help="").default
    6
    """
    shown = _shown(label, (low, high), slider)
    kind = Whole(
        label=label, help=help, low=low, high=high, unit=unit, shown=shown, at_most=at_most,
        typed=typed,
    )  # fmt: skip
    return _field(default, kind)


def choice(
    default: Any,
    options: Mapping[Any, str] | Iterable[Any],
    *,
    label: str,
    help: str,
    unit: str = "",
    slider: bool = False,
) -> Any:
    """Return a dataclass field for one of several values.

    Parameters
    ----------
    default : str or int
        Which is chosen at the start.
    options : mapping or iterable
        The values, strings or whole numbers; a mapping says what is shown for each.
    label, help, unit
        As for `number`.
    slider : bool, default False
        Whether it is set by a slider, and not from a list that drops down.

    Returns
    -------
    dataclasses.Field
        To be assigned in the body of a dataclass.

    Examples
    --------
    >>> dict(choice(8, [8, 16], label="places", help="").metadata["asked"].options)
    {8: '8', 16: '16'}
    """
    if not isinstance(options, Mapping):
        options = {value: str(value) for value in options}
    return _field(
        default, Choice(label=label, help=help, options=options, unit=unit, slider=slider)
    )


def switch(default: bool, *, label: str, help: str) -> Any:
    """Return a dataclass field for yes or no.

    Parameters
    ----------
    default, label, help
        As for `number`.

    Returns
    -------
    dataclasses.Field
        To be assigned in the body of a dataclass.

    Examples
    --------
    >>> switch(True, label="terminator", help="").default
    True
    """
    return _field(default, Switch(label=label, help=help))


def text(
    default: str, *, label: str, help: str, most: int = 200, rows: int = 1, hint: str = ""
) -> Any:
    """Return a dataclass field for text.

    Parameters
    ----------
    default, label, help
        As for `number`.
    most : int, default 200
        Characters that it may have.
    rows : int, default 1
        Lines of its control.
    hint : str, optional
        Shown while it is empty.

    Returns
    -------
    dataclasses.Field
        To be assigned in the body of a dataclass.

    Examples
    --------
    >>> text("", label="address", help="").metadata["asked"].rows
    1
    """
    return _field(default, Text(label=label, help=help, most=most, rows=rows, hint=hint))


def series(known: Iterable[str], *, most: int, label: str, help: str) -> Any:
    """Return a dataclass field for a row of strings that buttons lengthen; it starts empty.

    Parameters
    ----------
    known : iterable of str
        What may stand in it.
    most : int
        How many it may have.
    label, help
        As for `number`.

    Returns
    -------
    dataclasses.Field
        To be assigned in the body of a dataclass.

    Examples
    --------
    >>> series(["byte"], most=9, label="actions", help="").default
    ()
    """
    return _field((), Series(label=label, help=help, known=tuple(known), most=most))


def asked(kind: type) -> dict[str, Asked]:
    """Return what the fields of a dataclass ask for, by name and in order.

    Parameters
    ----------
    kind : type
        The dataclass; fields that were not made here are left out.

    Returns
    -------
    dict of str to Asked
        What is asked for.

    Examples
    --------
    >>> from shipnet.tools.asi_line import Inputs
    >>> asked(Inputs)["noise"].shown
    (0, 1.5)
    """
    return {one.name: one.metadata["asked"] for one in fields(kind) if "asked" in one.metadata}


def check(inputs: Any) -> None:
    """Raise unless all fields of a dataclass have legal values; for its `__post_init__`.

    Parameters
    ----------
    inputs : object
        Instance of the dataclass.

    Raises
    ------
    ArgumentError
        If one has not; the message names the field, its value and what is legal.

    Examples
    --------
    >>> from shipnet.tools.asi_line import Inputs
    >>> Inputs(noise=11)
    Traceback (most recent call last):
        ...
    shipnet.errors.ArgumentError: noise is 11 V; it must be 0..10 V
    """
    for name, kind in asked(type(inputs)).items():
        kind.check(name, getattr(inputs, name), inputs)
