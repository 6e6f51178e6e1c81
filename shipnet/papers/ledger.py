"""The ledger: what the papers print beside what shipnet computes, and the verdict.

`data/claims.csv` holds what is printed and how it is judged; the modules of the papers hold the
functions that recompute it. The *match* of a number follows from the two values and the printed
precision; the verdict is a judgement, and where it goes against a paper it names its evidence.
"""

from __future__ import annotations

import importlib
import math
import pkgutil
from collections.abc import Callable, Collection, Hashable
from functools import cache
from typing import Any

import pandas as pd

import shipnet.papers
from shipnet import datasets
from shipnet.papers.registry import REGISTRY

__all__ = ["PAPERS", "STATUSES", "VERDICTS", "as_number", "counts", "ledger", "match", "show"]

#: Keys of the papers, in the order in which they are shown.
PAPERS = ("kim2023", "icn2007", "lee2012", "chung1998", "kim2014")

#: What a verdict may be; `open` means that nobody computes the claim yet.
VERDICTS = (
    "agrees",
    "rounding",
    "typo",
    "unit",
    "wrong",
    "wrong term",
    "inconsistent",
    "assumption differs",
    "below rule",
    "not reproducible",
    "open",
)

#: What has been done about a claim.
STATUSES = ("recomputed", "checked", "ours", "context", "not reproducible", "open")


def as_number(text: str) -> float:
    """Return a printed number as a float; ``0x..`` is read as hexadecimal.

    Parameters
    ----------
    text : str
        The number as the paper prints it.

    Returns
    -------
    float
        Its value.

    Examples
    --------
    >>> as_number("0.104"), as_number("0x86")
    (0.104, 134.0)
    """
    return float(int(text, 16)) if text.lower().startswith("0x") else float(text)


def match(published: float, computed: float, precision: float) -> str:
    """Compare a printed number with a computed one.

    Parameters
    ----------
    published, computed : float
        Both in the unit of the claim.
    precision : float
        Unit of the last printed digit.

    Returns
    -------
    str
        ``"within precision"`` if they differ by at most half of `precision`;
        ``"factor 1000"`` or another power of ten, up to 10**9 and down to 10**-9, if a shift of
        the decimal point alone brings them that close; else ``"differs"``.

    Examples
    --------
    >>> match(0.4, 0.40323, precision=0.1)
    'within precision'
    >>> match(0.104, 104.17, precision=0.001)
    'factor 1000'
    """
    slack = 0.5 * precision * (1 + 1e-9)
    if abs(computed - published) <= slack:
        return "within precision"
    if computed and published:
        for power in sorted(range(-9, 10), key=abs):
            if power and abs(computed / 10.0**power - published) <= slack:
                return f"factor {10.0**power:g}"
    return "differs"


#: Papers whose claims are registered by another's modules too.
_LEANS_ON = {"icn2007": "kim2023", "kim2023": "icn2007"}


def _load_recomputations(papers: Collection[str] = PAPERS) -> None:
    """Import what recomputes some papers; the others are left alone, for they take their time."""
    wanted = {*papers, *(_LEANS_ON[paper] for paper in papers if paper in _LEANS_ON)}
    for module in pkgutil.iter_modules(shipnet.papers.__path__):
        if module.name in wanted:
            importlib.import_module(f"shipnet.papers.{module.name}")


def ledger(paper: str | None = None) -> pd.DataFrame:
    """Return the ledger of one paper or of all.

    Parameters
    ----------
    paper : str, optional
        Key of a paper, one of `PAPERS`; all if omitted.

    Returns
    -------
    pandas.DataFrame
        One row a claim: id, paper, where, kind, claim, published (as printed), unit, computed
        (a float, or a bool for a statement, or None), relative_difference (computed over
        published, minus 1; NaN if there is none), match, verdict, status, evidence, note.

    Raises
    ------
    ValueError
        If there is no such paper.

    Examples
    --------
    >>> row = ledger("kim2023").set_index("id").loc["kim2023-074"]
    >>> row.published, round(row.computed, 2), row.match, row.verdict
    ('0.7', 7.37, 'factor 10', 'typo')
    """
    rows = [_judge(claim) for claim in _claims(paper)]
    order = {key: place for place, key in enumerate(PAPERS)}
    return pd.DataFrame(rows, columns=list(_COLUMNS)).sort_values(
        ["paper", "id"],
        key=lambda column: column.map(order) if column.name == "paper" else column,
        ignore_index=True,
    )


def _claims(paper: str | None = None) -> list[dict[Hashable, Any]]:
    if paper is not None and paper not in PAPERS:
        raise ValueError(f"paper is {paper!r}, but the papers are {', '.join(PAPERS)}")
    papers = PAPERS if paper is None else (paper,)
    _load_recomputations(papers)
    claims = datasets.read("claims.csv")
    return claims[claims["paper"].isin(papers)].to_dict("records")


_COLUMNS = (
    "id",
    "paper",
    "where",
    "kind",
    "claim",
    "published",
    "unit",
    "computed",
    "relative_difference",
    "match",
    "verdict",
    "status",
    "evidence",
    "note",
)


@cache
def _computed(function: Callable[[], Any]) -> Any:
    """Call what recomputes a claim, once: it has no other inputs than its defaults."""
    return function()


def _judge(claim: dict[Hashable, Any]) -> dict[str, object]:
    """Put one claim beside its recomputation."""
    recomputation = REGISTRY.get(claim["id"])
    computed: Any = _computed(recomputation.function) if recomputation else None
    difference, outcome = math.nan, ""
    if recomputation and claim["kind"] == "numeric":
        published = as_number(claim["value"])
        outcome = match(published, computed, as_number(claim["precision"]))
        difference = computed / published - 1 if published else math.nan
    elif recomputation and claim["kind"] == "qualitative":
        outcome = "holds" if computed else "does not hold"
    return {
        **{key: claim[key] for key in ("id", "paper", "where", "kind", "claim", "unit", "note")},
        "published": claim["value"],
        "computed": computed,
        "relative_difference": difference,
        "match": outcome,
        "verdict": claim["verdict"],
        "status": _status(claim),
        "evidence": claim["evidence"] or (recomputation.evidence if recomputation else ""),
    }


def _status(claim: dict[Hashable, Any]) -> str:
    if claim["kind"] == "context":
        return "context"
    if claim["id"] in REGISTRY:
        return {"numeric": "recomputed", "qualitative": "checked", "ours": "ours"}[claim["kind"]]
    return "not reproducible" if claim["verdict"] == "not reproducible" else "open"


def counts(paper: str | None = None) -> pd.DataFrame:
    """Count the claims of each paper by what has been done about them.

    Parameters
    ----------
    paper : str, optional
        Key of a paper; all if omitted.

    Returns
    -------
    pandas.DataFrame
        One row a paper, one column for each of `STATUSES`, and ``claims``, their sum.

    Examples
    --------
    >>> bool((counts()["claims"] > 30).all())
    True
    """
    claims = _claims(paper)
    counted = pd.crosstab(
        pd.Index([claim["paper"] for claim in claims], name="paper"),
        pd.Index([_status(claim) for claim in claims], name="status"),
    )
    keys = [key for key in PAPERS if key in counted.index]
    counted = counted.reindex(index=keys, columns=list(STATUSES), fill_value=0)
    counted.columns.name, counted.index.name = None, "paper"
    return counted.assign(claims=counted.sum(axis=1))


def show(*claims: str) -> pd.DataFrame:
    """Show claims as a notebook does: what the paper says, what we compute, the verdict.

    Parameters
    ----------
    *claims : str
        Claim ids, such as ``"kim2023-004"``; one string may hold several with spaces between.

    Returns
    -------
    pandas.DataFrame
        One row a claim, in the order given.

    Raises
    ------
    ValueError
        If an id is unknown.

    Examples
    --------
    >>> show("kim2023-004").loc["kim2023-004", "we compute"]
    '0.4032 %'
    """
    known = {claim["id"]: claim for claim in datasets.read("claims.csv").to_dict("records")}
    ids = " ".join(claims).split()
    unknown = [claim for claim in ids if claim not in known]
    if unknown:
        raise ValueError(f"no claim {', '.join(unknown)}; ids look like {next(iter(known))!r}")
    _load_recomputations({str(known[claim]["paper"]) for claim in ids})
    rows = [_judge(known[claim]) for claim in ids]
    shown = {
        "where": [row["where"] for row in rows],
        "claim": [row["claim"] for row in rows],
        "the paper says": [_with_unit(str(row["published"]), row["unit"]) for row in rows],
        "we compute": [
            _with_unit(
                format_computed(row["computed"], str(row["published"])),
                "" if isinstance(row["computed"], bool) else row["unit"],
            )
            for row in rows
        ],
        "verdict": [row["verdict"] for row in rows],
    }
    return pd.DataFrame(shown, index=ids)


def _with_unit(value: str, unit: object) -> str:
    return f"{value} {unit}".strip() if value else ""


def format_computed(value: object, published: str = "") -> str:
    """Write a computed value for people: four significant digits, or whether a statement holds.

    Parameters
    ----------
    value : float, bool or None
        As in the column ``computed`` of the ledger.
    published : str, optional
        What the paper prints; a hexadecimal number is answered by one.

    Returns
    -------
    str
        Empty if nothing was computed.

    Examples
    --------
    >>> format_computed(7.36842), format_computed(496.0), format_computed(False)
    ('7.368', '496', 'does not hold')
    >>> format_computed(22343.75)
    '22340'
    """
    if value is None or value is pd.NA:
        return ""
    if isinstance(value, bool):
        return "holds" if value else "does not hold"
    number = float(value)  # type: ignore[arg-type]
    if published.startswith("0x") and number.is_integer():
        return f"0x{int(number):X}"
    if number.is_integer():
        return f"{number:.0f}"
    text = f"{number:.4g}"
    return f"{float(text):.0f}" if "e+" in text and abs(number) < 1e9 else text
