"""The command line of the cases: options reach the case, and every case names options that its `run` has."""

import ast
import pathlib

import pytest
from command import command
from gallery import PICTURES

CASES = pathlib.Path(__file__).parents[2] / "cases"


def test_options_reach_the_case(capsys):
    asked, reported = {}, []

    def run(out, realizations=5, tol=0.5, seed=1):
        asked.update(out=out, realizations=realizations, tol=tol, seed=seed)
        return "values"

    words = ["--out", "folder", "--realizations", "7", "--seed", "3"]
    helps = {"realizations": "n", "tol": "t", "seed": "s"}
    command(run, "results", "one.png", "two.json", report=reported.append, arguments=words, **helps)
    assert asked == {"out": pathlib.Path("folder"), "realizations": 7, "tol": 0.5, "seed": 3}
    assert reported == ["values"]
    assert capsys.readouterr().out == "Files in folder: one.png, two.json\n"
    command(run, "results", "one.png", arguments=[])
    assert asked == {"out": pathlib.Path("results"), "realizations": 5, "tol": 0.5, "seed": 1}
    with pytest.raises(SystemExit):
        command(run, "results", "one.png", arguments=["--tol", "few"], tol="t")


@pytest.mark.parametrize("name", PICTURES)
def test_options_of_every_case(name):
    """They are keywords of its `run` with a default, and its pictures are among the files that it names."""
    module = ast.parse((CASES / f"{name}.py").read_text(encoding="utf-8"))
    (run,) = (node for node in module.body if isinstance(node, ast.FunctionDef) and node.name == "run")
    call = module.body[-1].body[0].value
    options = [argument.arg for argument in run.args.args[len(run.args.args) - len(run.args.defaults) :]]
    assert {keyword.arg for keyword in call.keywords} <= {"report", *options}
    assert PICTURES[name].keys() <= {node.value for node in call.args[2:]}
