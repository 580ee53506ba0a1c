"""The command line that all cases share."""

import argparse
import inspect
import pathlib


def command(run, folder, *files, report=None, arguments=None, **options) -> None:
    """Read the command line, run a case, and print what it found and where its files are.

    Parameters
    ----------
    run : callable
        ``run(out, ...)``: computes, writes the files and returns the values of the JSON file.
    folder : str
        Where the files go unless ``--out`` names another folder.
    *files : str
        Names of the files.
    report : callable, optional
        Prints the most important of these values.
    arguments : list of str, optional
        By default those of the process.
    **options : str
        What a keyword of `run` is, for the option of the same name and default.
    """
    parser = argparse.ArgumentParser(description=run.__globals__["__doc__"].partition("\n")[0])
    parser.add_argument("--out", type=pathlib.Path, default=folder, help="folder (default: %(default)s)")
    for name, help_text in options.items():
        default = inspect.signature(run).parameters[name].default
        parser.add_argument(
            f"--{name}", type=type(default), default=default, help=f"{help_text} (default: %(default)s)"
        )
    parsed = parser.parse_args(arguments)
    values = run(**vars(parsed))
    if report is not None:
        report(values)
    print(f"Files in {parsed.out}: {', '.join(files)}")
