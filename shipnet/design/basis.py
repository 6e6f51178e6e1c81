"""What a comparison rests on, beside its list and its place: every value by its name.

A name is that of the field: ``detour``, ``spare``, ``asi.length``, ``assumptions.labour_rate``. By
these names values are read from a file (`shipnet.design.basis_file`), varied one against another
(`shipnet.design.study`), and told where they are not the defaults.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, is_dataclass, replace
from difflib import get_close_matches
from functools import cache
from inspect import cleandoc
from typing import TYPE_CHECKING, Any

import numpy as np

from shipnet.design.catalogue import Range
from shipnet.design.costs.assumptions import Assumptions
from shipnet.design.plan import Settings
from shipnet.design.rules import HOST_TIME
from shipnet.design.site import Site
from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar

if TYPE_CHECKING:
    import pandas as pd

    from shipnet.design.site.trays import Place, Trays

__all__ = ["Basis", "changed", "legal", "meaning", "names", "shown"]

_ASSUMPTIONS = "assumptions."

#: Fields whose legal values are not told by refusing None.
_PROBES: Mapping[str, object] = {"host_time": -1.0, "bit_rates": (None,)}


@dataclass(frozen=True)
class Basis:
    """What a comparison rests on, beside its list and its place.

    Parameters
    ----------
    settings : Settings, optional
        Limits of the planners.
    assumptions : Assumptions, optional
        Prices, hours and factors.
    detour : float, default 1.15
        Laid length of a cable as a multiple of its route, for bends and what is in the way;
        assumed.
    tails : float, default 5.0
        Length for both ends of a cable together [m]; assumed.
    host_time : float, default 0.5
        What the host adds to a response where a rule counts it [s]; assumed.

    Raises
    ------
    ArgumentError
        If a value is out of its range.

    Examples
    --------
    >>> basis = Basis(detour=1.3).with_({"asi.length": 200, "assumptions.gland": 6})
    >>> print(basis)
    not the defaults: detour 1.3 (1.15), asi.length 200 (100.0), assumptions.gland [6, 6, 6] (...)
    >>> basis.settings.asi.length, basis.site((26, 6, 14)).detour
    (200, 1.3)
    """

    settings: Settings = field(default_factory=Settings)
    assumptions: Assumptions = field(default_factory=Assumptions)
    detour: float = 1.15
    tails: float = 5.0
    host_time: float = HOST_TIME

    def __post_init__(self) -> None:
        """Check every field."""
        if not isinstance(self.settings, Settings):
            raise ArgumentError(f"settings is {self.settings!r}; it must be Settings")
        if not isinstance(self.assumptions, Assumptions):
            raise ArgumentError(f"assumptions is {self.assumptions!r}; it must be Assumptions")
        self.site((0.0, 0.0, 0.0))
        check_scalar("host_time", self.host_time, "s", 0.0, 60.0)

    def __getitem__(self, name: str) -> Any:
        """Return a value by its name."""
        _check_name(name)
        if name.startswith(_ASSUMPTIONS):
            return self.assumptions[name.removeprefix(_ASSUMPTIONS)]
        value: Any = self if name in _OWN else self.settings
        for part in name.split("."):
            value = getattr(value, part)
        return value

    def with_(self, values: Mapping[str, object]) -> Basis:
        """Return a basis of which some values are others.

        Parameters
        ----------
        values : mapping of str to object
            New values by `names`; of an assumption, low, nominal and high, or one number.

        Returns
        -------
        Basis
            All of it.

        Raises
        ------
        ArgumentError
            If there is no such name, or a value is not legal; all faults at once.
        """
        made, faults = changed(self, values)
        if faults:
            raise ArgumentError("; ".join(faults))
        return made

    def site(self, cabinet: Place, trays: Trays | None = None) -> Site:
        """Return a site with these allowances.

        Parameters
        ----------
        cabinet, trays
            As `shipnet.design.site.Site`.

        Returns
        -------
        Site
            With `detour` and `tails`.
        """
        return Site(cabinet, trays, self.detour, self.tails)

    @property
    def changes(self) -> pd.DataFrame:
        """Values that are not the defaults: name, value, default, legal, meaning."""
        import pandas as pd

        default = Basis()
        rows = [
            (name, self[name], default[name], legal(name), meaning(name))
            for name in names()
            if self[name] != default[name]
        ]
        return pd.DataFrame(rows, columns=["name", "value", "default", "legal", "meaning"])

    @property
    def told(self) -> list[str]:
        """Each value that is not the default, with the default behind it, in words."""
        return [
            f"{row['name']} {shown(row['value'])} ({shown(row['default'])})"
            for row in self.changes.to_dict("records")
        ]

    def __str__(self) -> str:
        """Name the values that are not the defaults."""
        return f"not the defaults: {', '.join(self.told)}" if self.told else "all defaults"


#: Fields of the basis itself.
_OWN = ("detour", "tails", "host_time")


@cache
def names() -> tuple[str, ...]:
    """Return the names of all values.

    Returns
    -------
    tuple of str
        Those of the site and the host, of the planners, of each bus, and of the assumptions.

    Examples
    --------
    >>> names()[:5], names()[-1]
    (('detour', 'tails', 'host_time', 'spare', 'redundant'), 'assumptions.part_time')
    """
    settings = Settings()
    of_parts: list[str] = []
    plain: list[str] = []
    for own in fields(settings):
        value = getattr(settings, own.name)
        if is_dataclass(value):
            of_parts += [f"{own.name}.{inner.name}" for inner in fields(value)]
        else:
            plain.append(own.name)
    return (*_OWN, *plain, *of_parts, *(_ASSUMPTIONS + name for name in Assumptions()))


def changed(basis: Basis, values: Mapping[str, object]) -> tuple[Basis, list[str]]:
    """Return a basis with other values, and what is wrong with those that it did not take.

    Parameters
    ----------
    basis : Basis
        What to begin from.
    values : mapping of str to object
        As `Basis.with_`.

    Returns
    -------
    basis : Basis
        With all values that are legal.
    faults : list of str
        Name, value and legal values of each other one.

    Examples
    --------
    >>> changed(Basis(), {"asi.lenght": 90, "spare": 99})[1]
    ["there is no 'asi.lenght'; the nearest is asi.length", 'spare is 99; it must be 0..10']
    """
    faults = []
    for name, value in values.items():
        try:
            _check_name(name)
        except ArgumentError as fault:
            faults.append(str(fault))
            continue
        try:
            basis = _put(basis, name, _plain(value))
        except ArgumentError:
            faults.append(f"{name} is {_brief(value)}; it must be {legal(name)}")
    return basis, faults


@cache
def legal(name: str) -> str:
    """Return what a value may be.

    Parameters
    ----------
    name : str
        One of `names`.

    Returns
    -------
    str
        Range and unit, in words.

    Raises
    ------
    ArgumentError
        If there is no such name.

    Examples
    --------
    >>> legal("asi.length"), legal("redundant"), legal("can.bit_rates")
    ('1..10000 m', 'true or false', 'one or more of whole numbers 1000..1000000')
    """
    _check_name(name)
    if name.startswith(_ASSUMPTIONS):
        return "[low, nominal, high] in this order, or one number; 0 or more and finite"
    own = name.rpartition(".")[2]
    try:
        # Whoever checks a value says what is legal when it refuses one.
        _put(Basis(), name, _PROBES.get(own))
    except ArgumentError as refusal:
        said = str(refusal).partition("it must be ")[2]
        if own == "bit_rates":
            return said.replace("a whole number", "one or more of whole numbers")
        return said.replace("True or False", "true or false")
    raise AssertionError(f"{name} may be anything")


@cache
def meaning(name: str) -> str:
    """Return what a value is.

    Parameters
    ----------
    name : str
        One of `names`.

    Returns
    -------
    str
        As its documentation has it.

    Raises
    ------
    ArgumentError
        If there is no such name.

    Examples
    --------
    >>> meaning("asi.repeaters"), meaning("assumptions.gland")
    ('Repeaters in series between the master and a module.', 'EUR: a gland at one end of a cable')
    """
    _check_name(name)
    if name.startswith(_ASSUMPTIONS):
        entry = Assumptions().entry(name.removeprefix(_ASSUMPTIONS))
        return f"{entry.unit if entry.unit != '1' else 'factor'}: {entry.meaning}"
    part, _, own = name.rpartition(".")
    if name in _OWN:
        return _documented(Basis)[own]
    return _documented(type(getattr(Settings(), part)) if part else Settings)[own]


def _documented(kind: type[Any]) -> dict[str, str]:
    """Return what the parameters of a class mean, from its docstring."""
    section = cleandoc(str(kind.__doc__)).partition("Parameters\n----------\n")[2]
    found: dict[str, str] = {}
    for entry in re.finditer(r"^(\w[\w, ]*) : .*\n((?: {4}.*\n?)+)", section, re.MULTILINE):
        said = re.sub(r"`+| \[\d\]_", "", " ".join(entry[2].split()))
        found |= dict.fromkeys(entry[1].split(", "), said)
    return found


def shown(value: object) -> str:
    """Return a value as a file of settings has it.

    Parameters
    ----------
    value : bool, int, float, str, or tuple of these
        From a `Basis`.

    Returns
    -------
    str
        TOML.

    Examples
    --------
    >>> shown(True), shown((9600, 19200)), shown("8E1"), shown(Range(1, 2.5, 4))
    ('true', '[9600, 19200]', '"8E1"', '[1, 2.5, 4]')
    """
    if isinstance(value, tuple):
        return f"[{', '.join(map(shown, value))}]"
    if isinstance(value, bool):
        return "true" if value else "false"
    return f'"{value}"' if isinstance(value, str) else repr(value)


def _check_name(name: str) -> None:
    if name in names():
        return
    part, _, own = name.rpartition(".")
    beside = {other.rpartition(".")[2]: other for other in names() if _part(other) == part}
    near = get_close_matches(own, beside, n=1)
    elsewhere = [other for other in names() if other.rpartition(".")[2] == own]
    hint = "see shipnet design --show-settings"
    if elsewhere:
        hint = f"there is {' and '.join(elsewhere)}"
    elif near:
        hint = f"the nearest is {beside[near[0]]}"
    raise ArgumentError(f"there is no {_brief(name)}; {hint}")


def _part(name: str) -> str:
    return name.rpartition(".")[0]


def _put(basis: Basis, name: str, value: Any) -> Basis:
    part, _, own = name.rpartition(".")
    if name in _OWN:
        return replace(basis, **{name: value})
    if name.startswith(_ASSUMPTIONS):
        ends = value if isinstance(value, tuple) else (value,) * 3
        if len(ends) != 3 or not all(map(_is_number, ends)):
            raise ArgumentError(f"{name} is {value!r}; it must be three numbers or one")
        return replace(basis, assumptions=basis.assumptions.with_(**{own: Range(*ends)}))
    if part:
        value = replace(getattr(basis.settings, part), **{own: value})
    return replace(basis, settings=replace(basis.settings, **{part or own: value}))


def _plain(value: object) -> object:
    """Return a value as one that a check can take, however it was given."""
    if isinstance(value, np.generic | np.ndarray):
        value = value.tolist()
    if isinstance(value, list):
        value = tuple(value)
    for one in value if isinstance(value, tuple) else (value,):
        if not isinstance(one, bool | str) and not _is_number(one):
            raise ArgumentError("it is no value")
    return value


def _is_number(value: object) -> bool:
    # A whole number of any size may stand in a file; no float holds one beyond 1e308.
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return isinstance(value, float) or abs(value) < 2**63


def _brief(value: object) -> str:
    try:
        said = shown(value) if isinstance(value, bool) else repr(value)
    except ValueError:  # a whole number of more digits than Python prints
        said = "a very large number"
    return said if len(said) <= 60 else f"{said[:57]}..."
