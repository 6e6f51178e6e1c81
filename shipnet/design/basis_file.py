"""Files of settings: what a design rests on, as TOML that an engineer edits.

    detour = 1.3                    # values of the site and the planners
    asi.length = 200                # or under a line [asi]

    [assumptions]
    labour_rate = [55, 60, 70]      # low, nominal, high
    asi_module = 118                # a quotation

What is not named stays as it is.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from os import PathLike
from textwrap import wrap

from shipnet.design.basis import Basis, changed, legal, meaning, names, shown
from shipnet.errors import InputError
from shipnet.tables import read_bytes, text_of

__all__ = ["format_basis", "load_basis", "parse_basis"]

_HEAD = """\
# What a comparison rests on, beside its list and its place. Change what you know better, and delete
# the lines that you leave as they are.
"""

_WIDTH = 98

#: A value that is a number with a decimal comma, as much of Europe types it.
_COMMA = re.compile(r"^[\w. \t]+=[ \t]*([0-9]+,[0-9]+)[ \t]*(?:#.*)?$", re.MULTILINE)


def load_basis(path: str | PathLike[str]) -> Basis:
    """Read a file of settings.

    Parameters
    ----------
    path : path
        TOML.

    Returns
    -------
    Basis
        With the values of the file; all others are the defaults.

    Raises
    ------
    InputError
        If the file cannot be read, is no TOML, or holds names or values that are not legal: each
        with its name, its value and what it must be.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = (Path(folder) / "own.toml").write_text("detour = 1.3")
    ...     print(load_basis(Path(folder) / "own.toml"))
    not the defaults: detour 1.3 (1.15)
    """
    return parse_basis(text_of(read_bytes(path)), str(path))


def parse_basis(text: str, source: str = "text") -> Basis:
    r"""Read settings from text.

    Parameters
    ----------
    text : str
        TOML.
    source : str, default "text"
        What to call it in an error.

    Returns
    -------
    Basis
        As `load_basis`.

    Raises
    ------
    InputError
        As `load_basis`.

    Examples
    --------
    >>> parse_basis("[asi]\nlength = 200\n[assumptions]\ngland = [5, 8, 9]").assumptions["gland"]
    Range(low=5, nominal=8, high=9)
    >>> parse_basis("detour = 0.5\n[asi]\ninputs = 9")
    Traceback (most recent call last):
        ...
    shipnet.errors.InputError: text: detour is 0.5; it must be a number 1..10; asi.inputs is 9; ...
    """
    try:
        tables = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        said = " ".join(str(error).split())[:200]
        if comma := _COMMA.search(text):
            said += f"; {comma[1]} has a decimal comma, expected a point"
        raise InputError(source, f"is no TOML file: {said}") from None
    basis, faults = changed(Basis(), _flat(tables))
    if faults:
        raise InputError(source, *faults)
    return basis


def format_basis(basis: Basis) -> str:
    """Return settings as a file, with what each value is and may be.

    Parameters
    ----------
    basis : Basis
        What to write.

    Returns
    -------
    str
        TOML, from which `parse_basis` makes an equal basis.

    Examples
    --------
    >>> text = format_basis(Basis(detour=1.3))
    >>> parse_basis(text) == Basis(detour=1.3)
    True
    >>> print("".join(text.splitlines(keepends=True)[3:7]), end="")
    # Laid length of a cable as a multiple of its route, for bends and what is in the way; assumed.
    # It must be a number 1..10. Default 1.15.
    detour = 1.3
    <BLANKLINE>
    """
    default = Basis()
    lines = [_HEAD]
    table = ""
    for name in names():
        part, _, own = name.rpartition(".")
        assumed = part == "assumptions"
        if part != table:
            table = part
            lines.append(f"[{part}]")
            if assumed:
                lines.append(f"# Each must be {legal(name)}.")
            lines.append("")
        was = f" Default {shown(default[name])}." if basis[name] != default[name] else ""
        if assumed:
            lines.append(f"{own} = {shown(basis[name])}  # {meaning(name)}.{was}")
        else:
            lines += [f"# {line}" for line in wrap(meaning(name), _WIDTH)]
            lines += [f"# {line}" for line in wrap(f"It must be {legal(name)}.{was}", _WIDTH)]
            lines += [f"{own} = {shown(basis[name])}", ""]
    return "\n".join(lines) + "\n"


def _flat(tables: Mapping[str, object]) -> dict[str, object]:
    """Return values by names with their table."""
    found: dict[str, object] = {}
    for name, value in tables.items():
        if isinstance(value, dict):
            found |= {f"{name}.{own}": one for own, one in value.items()}
        else:
            found[name] = value
    return found
