"""The ledger: the printed and the computed values of the papers' claims, with verdicts.

`data/claims.csv` has the printed values and the verdicts. The *match* of a number follows from the
two values and the printed precision; the verdict is a judgement.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Hashable, Mapping, Sequence
from functools import cache
from html import escape
from typing import Any

from shipnet import datasets, style
from shipnet.errors import ArgumentError
from shipnet.fields import check_choice
from shipnet.lazy import Axes, pd
from shipnet.papers.registry import PAPERS, REGISTRY, load
from shipnet.parallel import track

#: Verdicts of claims that are not judged; the note says what is missing.
UNDECIDED = ("not verified", "not reproducible", "open")

#: The condition of a verdict that needs no qualification.
AS_PRINTED = "as printed"

#: What a verdict rests on, strongest first: recorded data; another program, a published table or a
#: second derivation; a model of ours alone; or how our code defines the thing.
GRADES = ("measurement", "independent", "own simulator", "definition")

#: Treatments of a claim: its grade if it is judged, or else the reason why not.
_REASONS = ("context", "not verified", "not reproducible", "open")
TREATMENTS = (*GRADES, "ours", "erratum", *_REASONS)

#: Parts of a paper's bar: the treatments that each counts, and its look.
_PARTS: dict[str, tuple[Sequence[str], dict[str, str]]] = {
    "measured or independent": (GRADES[:2], {"facecolor": "#0072B2"}),
    "own simulator": (GRADES[2:3], {"facecolor": "#56B4E9"}),
    "definition": (GRADES[3:], {"facecolor": "#d3e9f7"}),
    "ours or erratum": (("ours", "erratum"), {"facecolor": "white", "hatch": "////"}),
    "not judged": (_REASONS, {"facecolor": "white"}),
}

#: Attribute of a cell that contains text; a notebook would align it to the right.
LEFT = 'style="text-align: left; vertical-align: top"'


class Claim:
    """One claim of a paper: the printed and the computed value, and the verdict.

    Its attributes are the columns of `Ledger.table`.

    Parameters
    ----------
    id : str
        Id of a claim, such as ``"kim2023-074"``.

    Raises
    ------
    ArgumentError
        If no claim has this id.

    Examples
    --------
    >>> claim = Claim("kim2023-074")
    >>> claim
    <Claim kim2023-074: the paper says 0.7 %, we compute 7.368 %: erratum>
    >>> round(claim.recompute(slaves=100), 1)
    14.0
    """

    def __init__(self, id: str) -> None:
        (claim,) = _claims_by_id([id])
        self.id = str(claim["id"])
        self._row = _judge(claim)

    def __getattr__(self, name: str) -> Any:
        """Return a column of the ledger."""
        if name.startswith("_") or name not in self._row:
            raise AttributeError(f"a claim has no {name}; it has {', '.join(self._row)}")
        return self._row[name]

    def recompute(self, **inputs: Any) -> Any:
        """Return the value with some inputs replaced; without inputs, the value in the ledger."""
        if self.id not in REGISTRY:
            raise ArgumentError(f"claim {self.id} is not computed; its status is {self.status}")
        return REGISTRY[self.id](**inputs)

    def __repr__(self) -> str:
        says, ours = _says(self._row), _ours(self._row)
        verdict = self.verdict or self.kind
        return f"<Claim {self.id}: the paper says {says}, we compute {ours}: {verdict}>"


class Ledger:
    """The claims of one paper or of all, each with its recomputation and its verdict."""

    def __init__(self, paper: str | None = None) -> None:
        self.paper = paper
        self._claims = _claims(paper)

    def table(self) -> pd.DataFrame:
        """Return every claim, indexed by its id.

        `published` is as printed; `computed` is a float, or a bool for a statement, or None if not
        computed; `margin` is the relative distance of a statement from its limit, negative if it
        does not hold; `relative_difference` is computed / published - 1.
        """
        rows = [_judge(claim) for claim in track(self._claims, "claims")]
        return pd.DataFrame(rows).set_index("id")

    def counts(self) -> pd.DataFrame:
        """Return the number of claims of each paper by grade, or by the reason for not judging."""
        table = pd.DataFrame(self._claims)
        status = table.apply(_status, axis="columns")
        counted = pd.crosstab(table["paper"], table["grade"].where(status == "judged", status))
        order = table["paper"].unique()
        counted = counted.reindex(index=order, columns=list(TREATMENTS), fill_value=0)
        counted.columns.name, counted.index.name = None, "paper"
        return counted.assign(claims=counted.sum(axis=1))

    def judged(self) -> pd.DataFrame:
        """Return the recomputed numbers and the checked statements."""
        return self.table().query("status == 'judged'")

    def differing(self) -> pd.DataFrame:
        """Return the judged claims whose verdict is not ``"agrees"``, with the reasons."""
        columns = ["where", "claim", "published", "verdict", "holds_under", "corrected", "note"]
        return self.judged().query("verdict != 'agrees'")[columns]

    @style.applied
    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the number of claims of each paper by treatment; numbers below 4 have no label."""
        ax, counts = style.axes(ax), self.counts()
        left = counts["claims"] * 0
        for name, (treatments, look) in _PARTS.items():
            number = counts[[*treatments]].sum(axis=1)
            if not number.any():
                continue
            bars: Any = ax.barh(counts.index, number, left=left, linewidth=0.5, label=name)
            for bar in bars:
                bar.set(edgecolor="0.3", **look)
            for text in ax.bar_label(bars, number, label_type="center"):
                text.set(visible=int(text.get_text()) >= 4)
                text.set_bbox({"facecolor": "white", "edgecolor": "none", "pad": 1})
            left = left + number
        ax.invert_yaxis()
        ax.set_xlabel("claims")
        ax.grid(visible=False, axis="y")
        ax.legend(ncols=3, loc="lower center", bbox_to_anchor=(0.4, 1.0), columnspacing=1)
        return ax

    def __len__(self) -> int:
        return len(self._claims)

    def __str__(self) -> str:
        counts = self.counts().sum()
        agree = sum(claim["verdict"] == "agrees" for claim in self._claims)
        graded = ", ".join(f"{counts[grade]} {grade}" for grade in GRADES)
        return f"{len(self)} claims; judged: {graded}; {agree} agree, open: {counts['open']}"

    def __repr__(self) -> str:
        return f"<Ledger of {self.paper or 'all papers'}: {self}>"


def ledger(paper: str | None = None) -> Ledger:
    """Return the ledger of one paper or of all.

    Parameters
    ----------
    paper : str, optional
        A key of `PAPERS`; all papers if omitted.

    Returns
    -------
    Ledger
        The claims with their verdicts.

    Raises
    ------
    ArgumentError
        If no paper has this key.

    Examples
    --------
    >>> row = ledger("icn2007").table().loc["icn2007-005"]
    >>> row.published, round(row.computed, 4), row.match, row.verdict, row.holds_under
    ('6', 0.006, 'factor 0.001', 'unit', 'as printed')
    """
    return Ledger(paper)


class Shown:
    """Some claims: each with its verdict in words, both values, and the reason in its own line."""

    def __init__(self, ids: Collection[str]) -> None:
        self._rows: dict[str, dict[str, str]] = {}
        for claim in _claims_by_id(ids):
            row = _judge(claim)
            source = [str(row[name]) for name in ("id", "where", "grade")]
            self._rows[source[0]] = {
                "claim": str(row["claim"]),
                "verdict": _verdict(row),
                "the paper says": _says(row),
                "we compute": _ours(row),
                "reason": _reason(row),
                "source": ", ".join(filter(None, source)),
            }

    def table(self) -> pd.DataFrame:
        """Return one row per claim, indexed by its id; `source` is its id, place and grade."""
        return pd.DataFrame.from_dict(self._rows, orient="index")

    def __repr__(self) -> str:
        lines = []
        for row in self._rows.values():
            values = [f"{name}: {row[name]}" for name in list(row)[2:4] if row[name]]
            lines += [f"{row['claim']}: {row['verdict']}", "  " + "; ".join(values)]
            lines += [f"  {row['reason']}", f"  [{row['source']}]"]
        return "\n".join(line for line in lines if line.strip())

    def _repr_html_(self) -> str:
        heads, rows = ("claim", "verdict", "the paper says", "we compute"), []
        for row in self._rows.values():
            below = f"{escape(row['reason'])} <i>{row['source']}</i>".strip()
            rows.append("".join(f"<td {LEFT}>{escape(row[head])}</td>" for head in heads))
            rows.append(f'<td colspan="4" {LEFT}><small>{below}</small></td>')
        return html_table("shown", heads, rows)


def html_table(name: str, heads: Collection[str], rows: Collection[str]) -> str:
    """Return a table of a class of its own; a row is the HTML of its cells."""
    cells = "".join(f"<th {LEFT}>{head}</th>" for head in heads)
    lines = [f'<table class="dataframe {name}">', f"<thead><tr>{cells}</tr></thead>", "<tbody>"]
    return "\n".join([*lines, *(f"<tr>{row}</tr>" for row in rows), "</tbody></table>"])


def show(*claims: str) -> Shown:
    """Show claims with the verdict in words, both values, and the reason in its own line.

    Parameters
    ----------
    *claims : str
        Claim ids, such as ``"kim2023-004"``; one string may contain several, separated by spaces.

    Returns
    -------
    Shown
        The claims in the order given; ``table()`` returns them as a DataFrame.

    Raises
    ------
    ArgumentError
        If an id is unknown.

    Examples
    --------
    >>> show("kim2023-074")
    Conductors left with AS-i on the submarine, as a percentage of the hardwired ones: misprint
      the paper says: 0.7 %; we compute: 7.368 %
      Correct: 7.4 %. 28 of 380 is 7.4 %: the decimal point is in the wrong place
      [kim2023-074, 3.5.g]
    """
    return Shown(" ".join(map(str, claims)).split())


def as_number(text: str) -> float:
    """Return a printed number as a float; ``0x..`` is read as hexadecimal."""
    return float(int(text, 16)) if text.lower().startswith("0x") else float(text)


def match(published: float, computed: float, precision: float) -> str:
    """Compare a printed and a computed number; `precision` is the unit of the last printed digit.

    Return ``"within precision"`` if they differ by at most half of `precision`; ``"factor 1000"``
    or another power of ten from 10**-9 to 10**9, if they do so once the computed number is divided
    by this factor; else ``"differs"``.
    """
    slack = 0.5 * precision * (1 + 1e-9)
    if abs(computed - published) <= slack:
        return "within precision"
    if computed and published:
        for power in sorted(range(-9, 10), key=abs):
            if power and abs(computed / 10.0**power - published) <= slack:
                return f"factor {10.0**power:g}"
    return "differs"


@cache
def _rows() -> list[dict[Hashable, Any]]:
    """Return the rows of claims.csv."""
    return datasets.read("claims.csv").to_dict("records")


def _claims(paper: str | None) -> list[dict[Hashable, Any]]:
    """Return the rows of claims.csv for one paper or all."""
    if paper is not None:
        check_choice("paper", paper, PAPERS)
    return [claim for claim in _rows() if paper in (None, claim["paper"])]


def _claims_by_id(ids: Collection[str]) -> list[dict[Hashable, Any]]:
    """Return the rows of claims.csv with these ids, in the order given."""
    by_id = {claim["id"]: claim for claim in _rows()}
    if unknown := [id for id in ids if id not in by_id]:
        raise ArgumentError(
            f"no claim has the id {', '.join(unknown)}; ids look like {next(iter(by_id))!r}"
        )
    return [by_id[id] for id in ids]


def _judge(claim: dict[Hashable, Any]) -> dict[str, object]:
    """Return one claim with its recomputation, as a row of the ledger."""
    load([claim["paper"]])
    recomputation = REGISTRY.get(claim["id"])
    computed: Any = recomputation.value if recomputation else None
    difference, outcome, margin = math.nan, "", math.nan
    if claim["kind"] == "qualitative" and isinstance(computed, float):
        computed, margin = computed >= 0, computed
    if recomputation and claim["precision"]:
        published = as_number(claim["value"])
        outcome = match(published, computed, as_number(claim["precision"]))
        difference = computed / published - 1 if published else math.nan
    elif isinstance(computed, bool):
        outcome = "holds" if computed else "does not hold"
    return {
        **{key: claim[key] for key in ("id", "paper", "where", "kind", "claim")},
        "published": claim["value"],
        "unit": claim["unit"],
        "computed": computed,
        "margin": margin,
        "basis": claim["basis"],
        "grade": claim["grade"],
        "relative_difference": difference,
        "match": outcome,
        "verdict": claim["verdict"],
        "holds_under": claim["holds_under"],
        "corrected": claim["corrected"],
        "status": _status(claim),
        "evidence": claim["evidence"] or (recomputation.evidence if recomputation else ""),
        "note": claim["note"],
    }


def _status(claim: Mapping[Hashable, Any]) -> str:
    if claim["kind"] in ("ours", "erratum", "context"):
        return str(claim["kind"])
    if claim["verdict"] in UNDECIDED:
        return str(claim["verdict"])
    # What a value rests on is stated for each claim that a function computes.
    return "judged" if claim["basis"] else "open"


def _says(row: Mapping[str, Any]) -> str:
    """Return the printed value with its unit."""
    return f"{row['published']} {row['unit']}".strip() if row["published"] else ""


def computed_text(row: Mapping[Any, Any]) -> str:
    """Return the computed value without its unit, in hexadecimal if it is printed so.

    It is empty for an erratum whose value is a bool.
    """
    value = row["computed"]
    if value is None or (isinstance(value, bool) and row["kind"] == "erratum"):
        return ""
    if isinstance(value, bool):
        return "holds" if value else "does not hold"
    number = float(value)
    if str(row["published"]).startswith("0x") and number.is_integer():
        return f"0x{int(number):X}"
    if number.is_integer():
        return f"{number:.0f}"
    text = f"{number:.4g}"
    return f"{float(text):.0f}" if "e+" in text and abs(number) < 1e9 else text


def _ours(row: Mapping[str, Any]) -> str:
    """Return the computed value, with its unit if it is a number."""
    text = computed_text(row)
    unit = "" if isinstance(row["computed"], bool) or not text else row["unit"]
    margin = "" if math.isnan(row["margin"]) else f"(margin {row['margin']:.2g})"
    return f"{text} {margin or unit}".strip()


#: Verdicts and kinds in words.
_WORDS = {
    "unit": "wrong unit",
    "assumption differs": "holds only under our assumption",
    "erratum": "misprint",
    "context": "not judged",
    "ours": "our number",
}


def _verdict(row: Mapping[str, Any]) -> str:
    """Return the verdict in words, or why there is none."""
    word = str(row["verdict"] or row["kind"])
    return _WORDS.get(word, word)


def _reason(row: Mapping[str, Any]) -> str:
    """Return the condition of a verdict (unless "as printed"), the correction, and the note."""
    held, instead, note = (str(row[name]) for name in ("holds_under", "corrected", "note"))
    parts = [held if held != AS_PRINTED else "", f"Correct: {instead}" if instead else "", note]
    return ". ".join(part[:1].upper() + part[1:] for part in parts if part)
