"""README and the pages: every block of code runs and prints what stands below it; the reference is complete."""

import ast
import functools
import inspect
import json
import pathlib
import re
import shlex
import shutil
import tomllib

import matplotlib as mpl
import pytest

import fpk_rocking
import montecarlo
from fpk_rocking import Scene, cli, load_scene, melnikov, options, studies
from fpk_rocking.results.trust import DIAGNOSTICS, UNASKED
from fpk_rocking.risk.calibration import FEW, TOO_FEW
from fpk_rocking.risk.critical import LARGEST_FACTOR
from fpk_rocking.risk.study import MOVED

ROOT = pathlib.Path(__file__).parents[2]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
BLOCK = re.compile(r"^( *)```(\w+)\n(.*?)^\1```$", re.MULTILINE | re.DOTALL)
NUMBER = re.compile(r"-?\d+\.?\d*(?:e[-+]?\d+)?")

# What would take longer than a test may. Nothing that is printed below such a block depends on it.
SMALLER = {"realizations=10_000_000": "realizations=10_000"}
LESS_EXACT = {"fragility.md": {"cycles=10": "cycles=2"}}
OPTIONS = {"fpk": ["--cycles", "2", "--tol", "1e-2"], "mc": ["--cycles", "2", "--realizations", "500"]}
OPTIONS["compare"] = OPTIONS["fpk"] + OPTIONS["mc"]
OPTIONS["fragility"] = OPTIONS["mc"]
OPTIONS["risk"] = ["--realizations", "10", "--synthetic", "5", "--intensities", "0.3:2:4"]
# Blocks that are no examples: what a reader's shell shows, formulas, what only a cluster runs.
OTHER = {"text", "console", "math", "py"}


def blocks(page):
    """Language and text of every block of code of a page, in their order."""
    matches = BLOCK.findall(page.read_text(encoding="utf-8"))
    return [(language, re.sub(f"^{indent}", "", text, flags=re.MULTILINE)) for indent, language, text in matches]


def pages_with(*languages):
    """Parametrize a test by page."""
    pages = [page for page in PAGES if any(language in languages for language, _ in blocks(page))]
    return pytest.mark.parametrize("page", pages, ids=lambda page: str(page.relative_to(ROOT)))


def _words(text):
    return "".join(NUMBER.sub("#", text).split())


def expected(printed, shown):
    """Whether a text is another but for the last digits of its numbers, which another machine may round elsewhere."""
    if _words(printed) != _words(shown):
        return False
    pairs = zip(NUMBER.findall(printed), NUMBER.findall(shown), strict=True)
    return all(float(got) == pytest.approx(float(said), rel=0.02, abs=2e-9) for got, said in pairs)


def test_texts_are_told_apart():
    assert expected("S = 0.4697 ± 1e-05\n", "S = 0.47   ± 1e-05")
    assert not expected("S = 0.4697", "S = 0.4997")
    assert not expected("S = 0.4697", "P = 0.4697")
    assert not expected("1 2", "1")


def test_every_block_is_of_a_kind_that_is_run():
    kinds = {language for page in PAGES for language, _ in blocks(page)}
    assert kinds <= OTHER | {"python", "sh", "toml"}


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """Work in a folder with what pages call the reader's own: a scene and a record."""
    (tmp_path / "my.toml").write_text(load_scene("second").to_toml(), encoding="utf-8")
    (tmp_path / "rack.toml").write_text(Scene.from_block(0.5, 1.8, 3.0, 1.5).to_toml(), encoding="utf-8")
    (tmp_path / "pgv.csv").write_text("0.1,5e-2\n0.5,3e-3\n2,2.5e-5\n", encoding="utf-8")
    shutil.copy(ROOT / "cases" / "records" / "synthetic.AT2", tmp_path / "motion.AT2")
    monkeypatch.chdir(tmp_path)


SOLVERS = ("CycleOperator", "solve_fpk")
SOLVED = {name: functools.cache(getattr(fpk_rocking, name)) for name in SOLVERS}
"""Some pages, and examples of docstrings, solve the same."""


@pytest.mark.site
@pages_with("python")
def test_python_runs_and_prints_what_the_page_shows(page, capsys, monkeypatch):
    """All blocks of a page in one namespace, in a folder of their own."""
    for name, solved in SOLVED.items():
        monkeypatch.setattr(fpk_rocking, name, solved)
    smaller = SMALLER | LESS_EXACT.get(page.name, {})
    names, printed, ran = {}, "", 0
    with mpl.rc_context({"backend": "agg"}):
        for language, text in blocks(page):
            if language == "python":
                source = functools.reduce(lambda source, pair: source.replace(*pair), smaller.items(), text)
                exec(compile(source, str(page), "exec"), names)
                printed, ran = capsys.readouterr().out, ran + 1
            elif language == "text":
                assert expected(printed, text), f"{page.name}: printed\n{printed}\nshown\n{text}"
    assert ran


@pages_with("toml")
def test_toml_is_a_scene_or_a_part_of_one(page):
    for language, text in blocks(page):
        if language == "toml":
            table = tomllib.loads(text)
            parts = re.split(r"(?m)^(?=\[)", load_scene("main").to_toml())
            rest = [part for part in parts if part and re.match(r"\[(\w+)", part)[1] not in table]
            assert isinstance(Scene.from_toml("\n".join([text, *rest])), Scene)


@pytest.mark.site
@pages_with("sh")
def test_commands_run(page, capsys):
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    for text in (text for language, text in blocks(page) if language == "sh"):
        for line in filter(None, text.splitlines()):
            program, *arguments = shlex.split(line, comments=True)
            if program == "make":
                assert re.search(rf"^{arguments[0]}:.*## ", makefile, re.MULTILINE), line
            elif program == "python":
                assert (ROOT / arguments[0]).is_file(), line
            else:
                assert pathlib.Path(program).name == "fpk-rocking", line
                assert cli.main(arguments + OPTIONS.get(arguments[0], [])) == 0, capsys.readouterr().err


def test_no_line_of_a_paragraph_begins_a_list():
    """A line that begins with "1." or a dash amid a paragraph is a list to a reader of the page."""
    begins = re.compile(r"(1[.)]|[-+*]) ")
    for page in [*PAGES, ROOT / "CHANGELOG.md"]:
        text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
        for paragraph in re.split(r"\n\s*\n", text):
            first, *lines = paragraph.strip().split("\n")
            if not re.match(r"(\d+[.)]|[-+*#|>]) ", first):
                assert not [line for line in lines if begins.match(line)], f"{page.name}: {paragraph}"


def test_links_between_files_lead_somewhere():
    """Those of the pages are also checked where the site is built, README's are not."""
    for page in PAGES:
        text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
        for link in re.findall(r"\]\(([^)#\s]+)(?:#[^)]*)?\)", text):
            assert "://" in link or (page.parent / link).exists(), f"{page.relative_to(ROOT)}: {link}"


def test_external_links_are_well_formed():
    """No network is asked. Scripts that write pages are searched too."""
    files = [*PAGES, ROOT / "CHANGELOG.md", *ROOT.glob("docs/reference/*.rst"), *ROOT.glob("benchmarks/*.py")]
    text = "\n".join(path.read_text(encoding="utf-8") for path in files)
    forms = {
        r"https?://[^\s)>\]\"']+": r"https://[a-z.]+/[\w./-]*",
        r"\bdoi:? ?(10[^\s),]+)": r"10\.\d{4,9}/[\w.()/:;-]*\w",
        r"cond-mat/\w+": r"cond-mat/\d{7}",
    }
    for pattern, form in forms.items():
        links = set(re.findall(pattern, text))
        assert len(links) > 0, pattern
        assert [link for link in links if not re.fullmatch(form, link)] == []


def test_reference_has_every_public_name():
    text = "\n".join(page.read_text(encoding="utf-8") for page in (ROOT / "docs" / "reference").glob("*.rst"))
    shown = set(re.findall(r"^\.\. auto(?:function|class|exception):: (\w+)", text, re.MULTILINE))
    public = {*fpk_rocking.__all__, *montecarlo.__all__, *studies.__all__, *melnikov.__all__} - {"melnikov"}
    assert public - shown == set()


def test_all_reasons_of_a_verdict_are_listed_by_name():
    """Error figures in the table of the page on results, all others in the reference: those that the sources make."""
    made = set(DIAGNOSTICS)
    for path in (path for package in ("fpk_rocking", "montecarlo") for path in (ROOT / package).rglob("*.py")):
        for call in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(call, ast.Call) and getattr(call.func, "id", "") == "Diagnostic":
                made |= {name.value for name in call.args[2:3] if isinstance(name, ast.Constant)}
    table = (ROOT / "docs" / "results.md").read_text(encoding="utf-8")
    cells = re.findall(r"^\| (`\w+`(?:, `\w+`)*)[:,] ", table, re.MULTILINE)
    page = (ROOT / "docs" / "reference" / "reasons.rst").read_text(encoding="utf-8")
    others = re.findall(r"^``(.+)``\n    ", page, re.MULTILINE)
    assert sorted([*re.findall(r"\w+", " ".join(cells)), *others]) == sorted(made - {""})
    for text in (
        f"as wide as ±{UNASKED:g}, or".replace("0.", "."),
        f"by more than {LARGEST_FACTOR:g}.",
        f"more than {100.0 * MOVED:g} % with the last",
        f"Fewer than {FEW:g} draws of `calibrated` count effectively; fewer than {TOO_FEW:g},",
    ):
        assert text in page


def test_scenes_of_the_package_are_named_where_a_reader_looks():
    names = {path.stem for path in (ROOT / "cases" / "scenes").glob("*.toml")}
    assert names == set(re.findall(r'``"([a-z0-9_]+)"``', inspect.getdoc(load_scene)))
    for name in names:
        assert load_scene(name) == load_scene(ROOT / "cases" / "scenes" / f"{name}.toml")
        assert name in options.EXAMPLES
        assert f"`{name}`" in (ROOT / "docs" / "howto" / "install.md").read_text(encoding="utf-8")
    with pytest.raises(FileNotFoundError, match=r"no scene file 'absent' .*of the package: fig05, main, record, "):
        load_scene("absent")


def test_a_file_goes_before_a_scene_of_its_name_where_it_is_a_path(tmp_path):
    (tmp_path / "main").write_text(load_scene("second").to_toml(), encoding="utf-8")
    assert load_scene("./main") == load_scene(pathlib.Path("main")) == load_scene("second")
    assert load_scene("main") != load_scene("second")


def test_files_to_download_are_those_that_the_page_shows():
    folder = ROOT / "docs" / "tutorials"
    page = (folder / "fragility.md").read_text(encoding="utf-8")
    assert f"```toml\n{(folder / 'rack.toml').read_text(encoding='utf-8')}```" in page
    lines = (folder / "pgv.csv").read_text(encoding="utf-8").splitlines()
    assert "\n\n" + "".join(f"    {line}\n" for line in lines) + "\n" in page


def test_notebooks_hold_no_output():
    """The site runs them; what a file shows would grow old."""
    notebooks = sorted((ROOT / "docs" / "notebooks").glob("*.ipynb"))
    assert notebooks
    for path in notebooks:
        cells = [cell for cell in json.loads(path.read_text(encoding="utf-8"))["cells"] if cell["cell_type"] == "code"]
        assert all(not cell["outputs"] and cell["execution_count"] is None for cell in cells), path.name
