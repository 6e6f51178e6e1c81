"""A printed table beside one that the code generates, cell by cell."""

from __future__ import annotations

import pandas as pd

from shipnet import datasets
from shipnet.asi.profile import Profile
from shipnet.asi.telegram import Request, Response

__all__ = ["KIM2023", "differences", "explained", "generated", "printed"]

#: The tables of kim2023 that the code generates, with the files of what is printed.
KIM2023 = {
    "Table 4": "kim2023_table4_request_fields.csv",
    "Table 5": "kim2023_table5_requests.csv",
    "Table 6": "kim2023_table6_response_fields.csv",
    "Table 7": "kim2023_table7_io_codes.csv",
}


def _known(table: str) -> str:
    if table not in KIM2023:
        raise ValueError(f"table is {table!r}; the generated ones are {', '.join(KIM2023)}")
    return KIM2023[table]


def printed(table: str) -> pd.DataFrame:
    """Return a table of kim2023 as it is printed.

    Parameters
    ----------
    table : str
        ``"Table 4"`` to ``"Table 7"``.

    Returns
    -------
    pandas.DataFrame
        Text cells, indexed by the first column.

    Examples
    --------
    >>> printed("Table 5").loc["RESET", "I3"]
    'S'
    """
    rows = datasets.read(_known(table))
    return rows.set_index(rows.columns[0]).drop(columns="name_printed", errors="ignore")


def generated(table: str) -> pd.DataFrame:
    """Return the same table from the code that encodes and decodes.

    Parameters
    ----------
    table : str
        ``"Table 4"`` to ``"Table 7"``.

    Returns
    -------
    pandas.DataFrame
        Text cells, with the rows and columns of `printed` as far as both have them.

    Examples
    --------
    >>> generated("Table 5").loc["RESET", "I3"]
    '~S'
    """
    _known(table)
    if table == "Table 4":
        return Request.fields().astype(str)
    if table == "Table 6":
        return Response.fields().astype(str)
    if table == "Table 7":
        return Profile.table()
    requests = Request.table()
    header = pd.DataFrame([requests.columns], index=["HEADER"], columns=requests.columns)
    return pd.concat([header, requests]).rename_axis("call")


def differences(table: str) -> pd.DataFrame:
    """List every cell in which a printed table and the generated one differ.

    Parameters
    ----------
    table : str
        ``"Table 4"`` to ``"Table 7"``.

    Returns
    -------
    pandas.DataFrame
        Columns table, row, column, printed, ours. A row that only one side has stands once, with
        an empty column name.

    Examples
    --------
    >>> len(differences("Table 7"))
    0
    """
    theirs, ours = printed(table), generated(table)
    found = []
    for row in ours.index.union(theirs.index, sort=False):
        if row not in theirs.index or row not in ours.index:
            there = row in theirs.index
            found.append(
                (table, row, "", "a row" if there else "no row", "no row" if there else "a row")
            )
            continue
        for column in ours.columns:
            pair = theirs.loc[row, column], ours.loc[row, column]
            if pair[0] != pair[1]:
                found.append((table, row, column, *pair))
    return pd.DataFrame(found, columns=["table", "row", "column", "printed", "ours"])


def explained(table: str) -> pd.DataFrame:
    """Return the differences of a table, each with its kind, its claim and its reason.

    Parameters
    ----------
    table : str
        ``"Table 4"`` to ``"Table 7"``.

    Returns
    -------
    pandas.DataFrame
        The rows of `differences` with the columns kind, claim and reason; NaN in these would be
        a difference that nobody has explained, which a test forbids.

    Examples
    --------
    >>> explained("Table 5").set_index(["row", "column"]).loc[("RESET", "I3"), "claim"]
    'kim2023-047'
    """
    reasons = datasets.read("kim2023_table_differences.csv")
    return differences(table).merge(reasons, on=["table", "row", "column"], how="left")
