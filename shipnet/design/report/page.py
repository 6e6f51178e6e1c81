"""One page of HTML that stands alone: tables, pictures and text, nothing fetched, nothing run.

Whatever goes in as text is escaped; so a tag of an I/O list cannot become a tag of the page.
"""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Iterable, Sequence
from html import escape

__all__ = ["bullets", "document", "picture", "section", "table", "text"]

_STYLE = """
@page { size: A4; margin: 16mm 14mm; }
:root { --ink: #1d2733; --soft: #5a6673; --rule: #cfd6dd; --band: #f3f6f8; }
* { box-sizing: border-box; }
body { font: 15px/1.45 system-ui, "Segoe UI", Roboto, "Liberation Sans", Arial, sans-serif;
  color: var(--ink); max-width: 1080px; margin: 0 auto; padding: 24px; background: #fff; }
h1 { font-size: 27px; line-height: 1.2; margin: 0 0 4px; }
h2 { font-size: 20px; margin: 36px 0 8px;
  border-bottom: 2px solid var(--ink); padding-bottom: 3px; }
h3 { font-size: 16px; margin: 22px 0 6px; }
p.lead { color: var(--soft); margin: 0 0 14px; }
p.banner { border: 2px solid #b03a2e; color: #8c2a20; background: #fdf3f1; padding: 9px 13px;
  margin: 14px 0; font-weight: 600; }
p.banner span { font-weight: 400; color: var(--ink); }
div.wide { overflow-x: auto; }
table { border-collapse: collapse; margin: 8px 0 14px; font-size: 13px; width: 100%; }
caption { text-align: left; color: var(--soft); padding: 4px 0; }
th, td { padding: 3px 8px; text-align: left; vertical-align: top;
  border-bottom: 1px solid var(--rule);
  overflow-wrap: anywhere; }
thead th { background: var(--band); border-bottom: 1px solid var(--ink); overflow-wrap: normal; }
td.n, th.n { text-align: right; font-variant-numeric: tabular-nums; overflow-wrap: normal; }
td.k { white-space: nowrap; }
td.pass { color: #1e6b3a; } td.fail { color: #a32a1c; font-weight: 600; }
td.open { color: #7a5a00; }
figure { margin: 10px 0 16px; break-inside: avoid; }
figure img { max-width: 100%; height: auto; }
figcaption { color: var(--soft); font-size: 13px; }
div.pair { display: grid; grid-template-columns: 1fr 1fr; gap: 14px; }
@media (max-width: 760px) { div.pair { grid-template-columns: 1fr; } body { padding: 12px; } }
@media print {
  body { font-size: 10pt; max-width: none; padding: 0; }
  table { font-size: 8.2pt; } th, td { padding: 2px 5px; }
  div.wide { overflow: visible; }
  h2, h3, caption { break-after: avoid; } tr { break-inside: avoid; }
  thead { display: table-header-group; }
  section.page { break-before: page; }
}
"""


def document(title: str, *parts: str) -> str:
    """Return a whole page.

    Parameters
    ----------
    title : str
        Shown by the browser, and when printed.
    *parts : str
        HTML that the other functions made.

    Returns
    -------
    str
        HTML with its style in it.

    Examples
    --------
    >>> document("A & B", text("x")).count("A &amp; B")
    1
    """
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>{_STYLE}</style>\n</head>\n<body>\n"
        + "\n".join(parts)
        + "\n</body>\n</html>\n"
    )


def section(title: str, *parts: str, page: bool = True) -> str:
    r"""Return a section with its heading.

    Parameters
    ----------
    title : str
        The heading.
    *parts : str
        HTML that the other functions made.
    page : bool, default True
        Whether it begins a page when printed.

    Returns
    -------
    str
        HTML.

    Examples
    --------
    >>> section("1 < 2", page=False)
    '<section>\n<h2>1 &lt; 2</h2>\n\n</section>'
    """
    kind = ' class="page"' if page else ""
    body = "\n".join(parts)
    return f"<section{kind}>\n<h2>{escape(title)}</h2>\n{body}\n</section>"


def text(words: str, kind: str = "", tag: str = "p") -> str:
    """Return a paragraph, or another element that holds text alone.

    Parameters
    ----------
    words : str
        What it says.
    kind : str, optional
        Its class.
    tag : str, default "p"
        Which element.

    Returns
    -------
    str
        HTML.

    Examples
    --------
    >>> text("<script>", "lead")
    '<p class="lead">&lt;script&gt;</p>'
    """
    named = f' class="{kind}"' if kind else ""
    return f"<{tag}{named}>{escape(words)}</{tag}>"


def bullets(lines: Iterable[str]) -> str:
    r"""Return a list.

    Parameters
    ----------
    lines : iterable of str
        One entry each.

    Returns
    -------
    str
        HTML.

    Examples
    --------
    >>> bullets(["a", "b"])
    '<ul>\n<li>a</li>\n<li>b</li>\n</ul>'
    """
    return "\n".join(["<ul>", *(f"<li>{escape(line)}</li>" for line in lines), "</ul>"])


def table(
    head: Sequence[str],
    rows: Iterable[Sequence[str]],
    *,
    caption: str = "",
    numbers: Iterable[int] = (),
    verdicts: Iterable[int] = (),
) -> str:
    """Return a table.

    Parameters
    ----------
    head : sequence of str
        Titles.
    rows : iterable of sequence of str
        Cells.
    caption : str, optional
        What stands above it.
    numbers : iterable of int, optional
        Columns that are set to the right.
    verdicts : iterable of int, optional
        Columns whose cells begin with a verdict, by which they are coloured.

    Returns
    -------
    str
        HTML.

    Examples
    --------
    >>> '<td class="k fail">fail</td>' in table(["a"], [["fail"]], verdicts=[0])
    True
    """
    right, judged = set(numbers), set(verdicts)

    def cell(tag: str, place: int, value: str) -> str:
        kinds = ["n"] * (place in right)
        if tag == "td":
            # A short word is not broken, however narrow its column.
            kinds += ["k"] * (0 < len(value) <= _SHORT)
            if place in judged:
                kinds += [kind for word, kind in _VERDICTS.items() if value.startswith(word)]
        named = f' class="{" ".join(kinds)}"' if kinds else ""
        scope = ' scope="col"' if tag == "th" else ""
        return f"<{tag}{scope}{named}>{escape(value)}</{tag}>"

    lines = [f"<caption>{escape(caption)}</caption>"] if caption else []
    lines.append("<thead><tr>" + "".join(cell("th", *c) for c in enumerate(head)) + "</tr></thead>")
    body = ("<tr>" + "".join(cell("td", *c) for c in enumerate(row)) + "</tr>" for row in rows)
    return "\n".join(
        ['<div class="wide"><table>', *lines, "<tbody>", *body, "</tbody></table></div>"]
    )


#: Longest cell that stays on one line.
_SHORT = 9

_VERDICTS = {"pass": "pass", "fail": "fail", "not verified": "open"}


def picture(svg: str, words: str) -> str:
    """Return a picture with its caption.

    Parameters
    ----------
    svg : str
        The picture; as a data address it shares no name with another one.
    words : str
        The caption, which is also read out in its place.

    Returns
    -------
    str
        HTML.

    Examples
    --------
    >>> picture("<svg/>", "a curve")[:36]
    '<figure><img src="data:image/svg+xml'
    """
    data = b64encode(svg.encode()).decode()
    said = escape(words)
    return (
        f'<figure><img src="data:image/svg+xml;base64,{data}" alt="{said}">'
        f"<figcaption>{said}</figcaption></figure>"
    )
