"""Formulas as MathML, made at build time: pages need neither a script nor the network."""

import re

from docutils import nodes
from docutils.utils.math import MathError, latex2mathml
from sphinx.util import logging

_LOGGER = logging.getLogger(__name__)
_FUNCTION = r"\\(?:arc)?(?:cos|sin|tan|max|min|log|exp)h?(?![a-z])"
# What docutils does not read, in words that it does: fences of a given size, dots, fractions of bare digits; and the
# spaces around names of functions, which it leaves out.
_SPELLINGS = [
    (re.compile(r"\\[bB]igg?[lr]?(?![a-zA-Z])"), ""),
    (re.compile(r"\\dots(?![a-z])"), r"\\ldots"),
    (re.compile(r"\\([td]?frac)\s*(\d)\s*(\d)"), r"\\\1{\2}{\3}"),
    (re.compile(rf"(?<=[\w)}}])\s*({_FUNCTION})"), r"\\,\1"),
    (re.compile(rf"({_FUNCTION})\s*(?=[\w\\])(?!\\left)"), r"\1\\,"),
]


def _inline(self, node):
    self.body.append(_mathml(node, as_block=False))
    raise nodes.SkipNode


def _display(self, node):
    self.body.append(f'<div class="math">{_mathml(node, as_block=True)}</div>\n')
    raise nodes.SkipNode


def _mathml(node, as_block):
    tex = node.astext().strip()
    for pattern, written in _SPELLINGS:
        tex = pattern.sub(written, tex)
    try:
        return latex2mathml.tex2mathml(tex, as_block=as_block)
    except MathError as error:
        _LOGGER.warning("formula that docutils cannot read (%s): %s", error, tex, location=node)
        return f"<code>{nodes.Text(tex)}</code>"


def setup(app):
    """Register the renderer."""
    app.add_html_math_renderer("mathml", (_inline, None), (_display, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
