"""The site: Sphinx over this folder, `make docs`."""

import importlib.metadata
import pathlib
import sys

HERE = pathlib.Path(__file__).parent
sys.path[:0] = [str(HERE.parent), str(HERE / "_ext")]

project = "fpk-rocking"
copyright = "the fpk-rocking authors, BSD 3-Clause"  # noqa: A001
release = version = importlib.metadata.version("fpk-rocking")
language = "en-GB"

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.viewcode", "numpydoc", "bars", "cases", "command_help", "mathml"]
exclude_patterns = ["_build"]

myst_enable_extensions = ["dollarmath", "colon_fence"]
myst_fence_as_directive = ["math"]
myst_heading_anchors = 4

default_role = "py:obj"
autodoc_typehints = "none"
autodoc_member_order = "bysource"
numpydoc_show_class_members = False

html_theme = "furo"
html_title = f"fpk-rocking {release}"
html_math_renderer = "mathml"
html_copy_source = False
html_show_sphinx = False
