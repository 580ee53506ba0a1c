"""The site: Sphinx over this folder, `make docs`."""

import importlib.metadata
import pathlib
import sys

HERE = pathlib.Path(__file__).parent
sys.path[:0] = [str(HERE.parent), str(HERE / "_ext")]

from numpydoc.xref import DEFAULT_LINKS  # noqa: E402

import fpk_rocking  # noqa: E402
import montecarlo  # noqa: E402

project = "fpk-rocking"
copyright = "the fpk-rocking authors, BSD 3-Clause"  # noqa: A001
release = version = importlib.metadata.version("fpk-rocking")
language = "en-GB"

extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.viewcode", "numpydoc"]
extensions += ["bars", "cases", "command_help", "evidence", "mathml"]  # ours, in _ext

myst_enable_extensions = ["dollarmath", "colon_fence"]
myst_fence_as_directive = ["math"]
myst_heading_anchors = 4

# Notebooks are run with each build; the file holds no output.
nb_execution_mode = "force"
nb_execution_raise_on_error = True
nb_execution_timeout = 600

default_role = "py:obj"
autodoc_typehints = "none"
autodoc_member_order = "bysource"
numpydoc_show_class_members = False
numpydoc_xref_param_type = True
numpydoc_xref_ignore = "all"
# Types lead to this site's pages alone: to know those of other projects a build would need the network.
numpydoc_xref_aliases = {name: name for name in DEFAULT_LINKS} | {
    name: f"{package.__name__}.{name}" for package in (fpk_rocking, montecarlo) for name in package.__all__
}

html_theme = "furo"
html_title = f"fpk-rocking {release}"
html_math_renderer = "mathml"
html_copy_source = False
html_show_sphinx = False
html_static_path = ["_static"]
html_css_files = ["site.css"]
