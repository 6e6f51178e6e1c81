"""The data files, in the checkout or in the installed package."""

from __future__ import annotations

from difflib import get_close_matches
from pathlib import Path

from shipnet.errors import ArgumentError, InputError
from shipnet.lazy import pd

__all__ = ["names", "path", "read"]
__dir__ = __all__.copy

_PACKAGE = Path(__file__).resolve().parent

#: Tables, recordings, and rule bases.
_KINDS = (".csv", ".npz", ".sr", ".toml")


def _folder() -> Path:
    checkout = _PACKAGE.parent / "data"
    return checkout if (checkout / "SOURCES.md").is_file() else _PACKAGE / "data"


def names() -> list[str]:
    """Return the names of all data files, sorted.

    Returns
    -------
    list of str
        Names for `path` and `read`.

    Examples
    --------
    >>> "claims.csv" in names()
    True
    """
    return sorted(file.name for file in _folder().iterdir() if file.suffix in _KINDS)


def path(name: str) -> Path:
    """Return the path of a data file.

    Parameters
    ----------
    name : str
        File name, such as ``"claims.csv"``.

    Returns
    -------
    pathlib.Path
        The file in the checkout if there is one, else the copy inside the installed package.

    Raises
    ------
    ArgumentError
        If there is no such file; the message suggests the most similar names.

    Examples
    --------
    >>> path("claims.csv").name
    'claims.csv'
    """
    if name not in names():
        near = ", ".join(get_close_matches(str(name), names(), cutoff=0.3)) or names()[0]
        raise ArgumentError(f"name is {name!r}; it must be one of datasets.names(), such as {near}")
    return _folder() / name


def read(name: str) -> pd.DataFrame:
    """Return a data file as a table of strings; empty cells become empty strings.

    Nothing is converted, because a printed ``0.40`` is not ``0.4`` and ``03`` is not 3.

    Parameters
    ----------
    name : str
        File name, as for `path`.

    Returns
    -------
    pandas.DataFrame
        All columns of type str.

    Raises
    ------
    ArgumentError
        If there is no such file.
    InputError
        If the file is a recording or empty, or a row has more cells than there are titles.

    Examples
    --------
    >>> read("kim2023_table7_io_codes.csv").loc[1].tolist()
    ['1', 'IN', 'IN', 'IN', 'OUT']
    """
    try:
        return pd.read_csv(path(name), dtype=str, keep_default_na=False)
    except (pd.errors.EmptyDataError, pd.errors.ParserError, UnicodeDecodeError) as error:
        raise InputError(name, str(error).strip()) from None
