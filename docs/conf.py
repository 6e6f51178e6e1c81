"""Sphinx configuration of the book; docs/build.py assembles its source."""

import sys
from pathlib import Path

from jinja2.sandbox import SandboxedEnvironment
from numpydoc import docscrape_sphinx, xref

import shipnet

sys.path.insert(0, str(Path(__file__).parent / "_ext"))
from pages import OTHERS

project = "shipnet"
version = release = shipnet.__version__
copyright = "the shipnet authors"

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.viewcode",
    "numpydoc",
    "mathml",
    "captions",
    "pages",
]

# Notebooks to download are files, not pages.
exclude_patterns = ["downloads"]

# The notebooks already contain their outputs.
nb_execution_mode = "off"
nb_merge_streams = True
# The default would load require.js from a CDN, but the book must work offline.
nb_ipywidgets_js = {}

myst_enable_extensions = ["amsmath", "dollarmath"]
myst_dmath_double_inline = True
myst_heading_anchors = 3

# `name` in a docstring becomes a link if such an object exists, and code otherwise.
default_role = "obj"
autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
# The Parameters section gives the types, in words and with the unit.
autodoc_typehints = "none"
add_module_names = False
numpydoc_show_class_members = False
# Of the words in a type, those of other packages become links.
numpydoc_xref_param_type = True
numpydoc_xref_ignore = "all"
xref.DEFAULT_LINKS.clear()  # these need inventories from the network
numpydoc_xref_aliases = {short: name for name in OTHERS for short in (name, name.split(".")[-1])}
# numpydoc would create an environment and compile its template again for each docstring.
_made: dict[str, SandboxedEnvironment] = {}
docscrape_sphinx.SandboxedEnvironment = lambda loader: _made.setdefault(
    "numpydoc", SandboxedEnvironment(loader=loader)
)
smartquotes = False  # True would change the quotes in code such as {"A", "B"}
toc_object_entries_show_parents = "hide"

html_theme = "furo"
html_title = "shipnet"
html_math_renderer = "mathml"
html_static_path = ["_static"]
html_css_files = ["book.css"]
html_js_files = ["book.js"]
html_favicon = "_static/favicon.svg"
html_search_scorer = str(Path(__file__).parent / "_ext" / "scorer.js")
html_copy_source = False
html_show_copyright = False
