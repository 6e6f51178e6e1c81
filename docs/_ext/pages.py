"""Describe each page for search engines, and link to the documentation of other packages.

The book is built without a network, so the addresses are here instead of in their inventories.
"""

from __future__ import annotations

from html import escape
from textwrap import shorten
from typing import TYPE_CHECKING, Any

from docutils import nodes

if TYPE_CHECKING:
    from sphinx.addnodes import pending_xref
    from sphinx.application import Sphinx
    from sphinx.environment import BuildEnvironment
    from sphinx.util.typing import ExtensionMetadata

#: Pages of the objects of other packages that docstrings name.
OTHERS = {
    "collections.abc.Callable": "https://docs.python.org/3/library/collections.abc.html",
    "collections.abc.Mapping": "https://docs.python.org/3/library/collections.abc.html",
    "collections.abc.Sequence": "https://docs.python.org/3/library/collections.abc.html",
    "matplotlib.axes.Axes": "https://matplotlib.org/stable/api/_as_gen/matplotlib.axes.Axes.html",
    "numpy.ndarray": "https://numpy.org/doc/stable/reference/generated/numpy.ndarray.html",
    "numpy.random.Generator": "https://numpy.org/doc/stable/reference/random/generator.html",
    "pandas.DataFrame": "https://pandas.pydata.org/docs/reference/api/pandas.DataFrame.html",
    "pandas.Series": "https://pandas.pydata.org/docs/reference/api/pandas.Series.html",
    "pathlib.Path": "https://docs.python.org/3/library/pathlib.html#pathlib.Path",
}


def link(
    app: Sphinx, env: BuildEnvironment, node: pending_xref, words: nodes.TextElement
) -> nodes.reference | None:
    target = OTHERS.get(node["reftarget"])
    return target and nodes.reference("", "", words, refuri=target, internal=False)


def describe(
    app: Sphinx, page: str, template: str, context: dict[str, Any], doctree: nodes.document | None
) -> None:
    paragraph = doctree.next_node(nodes.paragraph) if doctree else None
    if paragraph is not None:
        text = escape(shorten(paragraph.astext(), 160, placeholder=" ..."))
        context["metatags"] += f'<meta name="description" content="{text}">'


def setup(app: Sphinx) -> ExtensionMetadata:
    app.connect("html-page-context", describe)
    app.connect("missing-reference", link)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
