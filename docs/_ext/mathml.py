"""Convert formulas to MathML when the book is built; the pages need no script and no network."""

from __future__ import annotations

import re
from html import escape
from typing import TYPE_CHECKING

from docutils import nodes
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.util import logging
from sphinx.util.math import get_node_equation_number

if TYPE_CHECKING:
    from sphinx.application import Sphinx
    from sphinx.util.typing import ExtensionMetadata
    from sphinx.writers.html5 import HTML5Translator

logger = logging.getLogger(__name__)

ENVIRONMENT = re.compile(r"\\begin\{((?:equation|align|gather)\*?)\}(.*)\\end\{\1\}", re.DOTALL)


def mathml(node: nodes.math | nodes.math_block) -> str:
    """Return the formula of `node` as MathML, or as code with a warning if that fails."""
    block = isinstance(node, nodes.math_block)
    latex = node.astext().strip()
    if outer := ENVIRONMENT.fullmatch(latex):
        latex = outer[2].strip()
    if block:
        # Sphinx separates the formulas of one directive with blank lines.
        latex = r" \\ ".join(part.strip() for part in re.split(r"\n\s*\n", latex))
    try:
        return tex2mathml(latex, as_block=block)
    except Exception as error:  # the parser also raises errors other than its MathError
        logger.warning("no MathML for %r: %s", latex, error, location=node, type="mathml")
        return f"<code>{escape(latex)}</code>"


def visit_math(self: HTML5Translator, node: nodes.math) -> None:
    self.body.append(mathml(node))
    raise nodes.SkipNode


def visit_math_block(self: HTML5Translator, node: nodes.math_block) -> None:
    self.body.append(self.starttag(node, "div", CLASS="formula"))
    self.body.append(mathml(node))
    if node["number"]:
        self.body.append(f'<span class="eqno">({get_node_equation_number(self, node)})')
        self.add_permalink_ref(node, "Link to this equation")
        self.body.append("</span>")
    self.body.append("</div>\n")
    raise nodes.SkipNode


def setup(app: Sphinx) -> ExtensionMetadata:
    app.add_html_math_renderer("mathml", (visit_math, None), (visit_math_block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
