"""Bars in docstrings, as in |x|, are absolute values and no substitutions of reStructuredText."""

import re


def escaped(text):
    """Return a text with a backslash before every bar that is not in literal text."""
    return re.sub(r"(``.*?``)|\|", lambda found: found[1] or r"\|", text)


def _docstring(_app, _what, _name, _thing, _options, lines):
    lines[:] = map(escaped, lines)


def setup(app):
    """Register the step, after numpydoc's."""
    app.connect("autodoc-process-docstring", _docstring, priority=900)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
