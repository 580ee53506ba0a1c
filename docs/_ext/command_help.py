"""The directive ``command-help``: what a command prints with ``--help``, under its name."""

import contextlib
import io
import os
from unittest import mock

from docutils import nodes
from sphinx.util.docutils import SphinxDirective

from fpk_rocking import cli


class CommandHelp(SphinxDirective):
    """``.. command-help:: fpk-rocking fpk``."""

    required_arguments = 1
    final_argument_whitespace = True

    def run(self):
        """Return a section with the text."""
        command = self.arguments[0]
        printed = io.StringIO()
        # argparse wraps its text to the terminal.
        width = mock.patch.dict(os.environ, {"COLUMNS": "100"})
        with contextlib.redirect_stdout(printed), width, contextlib.suppress(SystemExit):
            cli.main([*command.split()[1:], "--help"])
        text = nodes.literal_block(printed.getvalue(), printed.getvalue(), language="none")
        return [nodes.section("", nodes.title(command, command), text, ids=[nodes.make_id(command)])]


def setup(app):
    """Register the directive."""
    app.add_directive("command-help", CommandHelp)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
