"""Puts a mutant in place of its source: in the process that runs tests, and in every Python that a test starts.

Python runs this file by its name at its start. Nothing is written into the tree, so what is kept of a source on disk,
the machine code of the kernels that a mutant does not concern too, stays valid.
"""

import importlib.machinery
import json
import os
import pathlib


def put(file, source, compiled):
    """Have a file's module made from another source; where that is compiled, so is all that depends on it."""
    get_code, read = importlib.machinery.SourceFileLoader.get_code, pathlib.Path.read_bytes

    def get_changed(loader, name):
        return compile(source, file, "exec", dont_inherit=True) if loader.path == file else get_code(loader, name)

    importlib.machinery.SourceFileLoader.get_code = get_changed
    if compiled:
        # The cache of machine code goes by what it reads there.
        pathlib.Path.read_bytes = lambda path: source.encode() if str(path) == file else read(path)


if "FPK_ROCKING_MUTANT" in os.environ:
    put(**json.loads(os.environ["FPK_ROCKING_MUTANT"]))
