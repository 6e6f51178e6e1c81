"""Add an alternative text to each figure of a notebook, and mark the narrow forms of figures."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from docutils import nodes
from PIL import Image
from sphinx.transforms import SphinxTransform
from sphinx.util import logging

if TYPE_CHECKING:
    from sphinx.application import Sphinx
    from sphinx.util.typing import ExtensionMetadata

logger = logging.getLogger(__name__)


class Captions(SphinxTransform):
    """Use each figure's caption as its alternative text; load it once it is shown.

    myst-nb itself uses the image's hash as the alternative text.
    """

    default_priority = 400

    def apply(self, **_: Any) -> None:
        for cell in self.document.findall(nodes.container):
            if cell.get("nb_element") != "cell_code":
                continue
            caption = cell.next_node(descend=False, siblings=True)
            for image in cell.findall(nodes.image):
                if isinstance(caption, nodes.paragraph):
                    image["alt"] = caption.astext().replace("\n", " ")
                else:
                    logger.warning("no caption below this figure", location=image)
                image["loading"] = "lazy"  # the form that is not shown is not loaded
                if "width" in image and "height" not in image:  # see docs/narrow.py
                    image["classes"].append("narrow")
                    _, file = self.env.relfn2path(image["uri"], self.env.docname)
                    with Image.open(file) as picture:
                        image["height"] = str(picture.height // 2)


def setup(app: Sphinx) -> ExtensionMetadata:
    app.add_transform(Captions)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
