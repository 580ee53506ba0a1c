"""The one-file report: it needs nothing else, and its numbers and densities are those of the result."""

import base64
import contextlib
import dataclasses
import html.parser
import io
import json
import math
import pathlib
import shutil
import subprocess

import fakes
import numpy as np
import pytest

from fpk_rocking import BandNoise, Block, Harmonic, Scene, cli
from fpk_rocking.compare import compare
from fpk_rocking.output.report import left_out, write_report
from fpk_rocking.results.pictures import OVERTURNED, edges_of

MAIN = Scene(Block(0.5), Harmonic(4.6, 2.7, math.pi), BandNoise(0.04, (0.0, 10.0), 100))
DENSITY, ENSEMBLE = fakes.FakeEvolution(MAIN), fakes.FakeEnsemble(MAIN, realizations=2000)
SCRIPT = pathlib.Path(cli.__file__).parent / "output" / "report.js"


class Page(html.parser.HTMLParser):
    """What a page holds: texts by element, attributes, tables, and whether all that is opened is closed."""

    VOID = frozenset({"meta", "img", "input", "br"})

    def __init__(self, text):
        super().__init__()
        self.open, self.attributes, self.rows, self.texts, self.json = [], [], [], [], {}
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        self.attributes += attrs
        if tag not in self.VOID:
            self.open.append((tag, dict(attrs)))
        if tag == "tr":
            self.rows.append([])

    def handle_endtag(self, tag):
        assert self.open.pop()[0] == tag

    def handle_data(self, data):
        tag, attrs = self.open[-1] if self.open else ("", {})
        if attrs.get("type") == "application/json":
            self.json[attrs["id"]] = json.loads(data)
        elif tag in {"td", "th"}:
            self.rows[-1].append(data)
        elif tag not in {"script", "style"}:
            self.texts.append(data)


def written(path, shown, values, films=(DENSITY,), **more):
    """Size that is told, and the page."""
    size = write_report(path, shown, values, films=films, **more)
    text = path.read_text(encoding="utf-8")
    assert size == path.stat().st_size
    return text, Page(text)


@pytest.fixture
def report(tmp_path):
    values = DENSITY.summary()
    return written(tmp_path / "out.html", DENSITY, values, scenes=[MAIN], sentences=["One < two & more."])


@pytest.fixture
def both(tmp_path):
    compared = compare(ENSEMBLE, DENSITY)
    return written(tmp_path / "out.html", compared, compared.summary(), [DENSITY, ENSEMBLE])[1]


def test_nothing_is_loaded_from_anywhere(report):
    text, page = report
    sources = [value for name, value in page.attributes if name in {"src", "href", "action", "data"}]
    assert [source[:22] for source in sources] == ["data:image/png;base64,"]
    assert "default-src 'none'" in text
    for loading in ("http:", "https:", "//cdn", "import(", "fetch(", "XMLHttpRequest", "@import", "url("):
        assert loading not in text
    names = [value for name, value in page.attributes if name == "id"]
    assert len(names) == len(set(names))


def test_numbers_are_those_of_the_result(report):
    _, page = report
    assert page.json["summary"] == json.loads(json.dumps(DENSITY.summary()))
    assert page.rows[0] == [
        "cycle",
        "time τ",
        "survival",
        "overturned left",
        "overturned right",
        "truncated",
        "at rest",
    ]
    survival = [float(row[2]) for row in page.rows[1:]]
    assert survival == pytest.approx(DENSITY.survival, rel=1e-5)
    assert page.texts.count(DENSITY.heading) == 2
    assert "trust: caution" in page.texts
    assert any("restitution = 0.5" in text for text in page.texts)
    assert "One < two & more." in page.texts


def test_it_says_what_the_model_leaves_out(report):
    """All that the page on it names."""
    sentence = next(text for text in report[1].texts if text.startswith("The model is"))
    page = (pathlib.Path(__file__).parents[2] / "docs" / "limits.md").read_text(encoding="utf-8")
    named = [row.split("**")[1].rstrip(".").lower() for row in page.splitlines() if row.startswith("| **")]
    words = ["slender", "sliding", "vertical", "three", "anchorage", "gravity", "flexible", "restitution"]
    for word, row in zip(words, named, strict=True):
        assert word in row
        assert word in sentence


def test_it_says_which_equation_of_motion_it_is_for():
    exact, slender = (dataclasses.replace(DENSITY.scene, block=Block(0.5, critical_angle=a)) for a in (0.2, 0.0))
    beginnings = [left_out(scenes).partition(". ")[0] for scenes in ([exact], [slender, slender], [exact, slender])]
    base = "The model is one rigid block that rocks in a plane on a rigid base"
    part = ", with the equation of motion of a slender one"
    assert beginnings == [base, base + part, f"{base}{part} in 1 of 2 scenes"]
    exact = dataclasses.replace(DENSITY.scene, block=Block(0.5, critical_angle=0.2))
    assert [
        ", and the scatter of restitution." in left_out([exact], scatter=scattered) for scattered in (True, False)
    ] == [
        True,
        False,
    ]


def test_densities_are_those_of_the_results(both):
    film = both.json["film"]
    edges = [np.array(film[axis]) for axis in ("angle", "velocity")]
    areas = np.multiply.outer(*map(np.diff, edges))
    for result, shown in zip((DENSITY, ENSEMBLE), film["films"], strict=True):
        assert shown["survival"] == result.survival.tolist()
        assert shown["overturned"] == result.overturned.tolist()
        for row in range(1, 11):
            codes = np.frombuffer(base64.b64decode(shown["codes"][row]), np.uint8).reshape(areas.shape)
            drawn = film["most"][row] * (codes / 255.0) ** 2
            density = result.bin_probabilities(row, *edges) / areas
            # A code is half a step off at most, and the root of density is what it is a step of.
            assert np.abs(np.sqrt(drawn) - np.sqrt(density)).max() < 0.51 / 255.0 * math.sqrt(film["most"][row])
    assert len(film["colours"]) == 256
    assert len(set(film["colours"])) > 200
    assert film["when"][:2] == ["after 0 cycles", "after 1 cycle"]
    assert film["begin"] == 10


def test_bins_are_shown_around_what_is_there():
    for line in edges_of([DENSITY], [4]):
        assert 64 <= line.size - 1 <= 128
    assert all(line.size - 1 <= 96 for line in edges_of([ENSEMBLE], [4]))


def test_of_many_cycles_some_are_shown(tmp_path):
    """The first and the last among them."""
    long = fakes.FakeEvolution(MAIN, cycles=500)
    _, page = written(tmp_path / "out.html", long, long.summary(), [long])
    film = page.json["film"]
    assert len(film["when"]) == 121
    assert (film["when"][0], film["when"][-1]) == ("after 0 cycles", "after 500 cycles")
    assert film["films"][0]["survival"][-1] == long.survival[-1]
    assert len(page.rows) == 502


def test_texts_of_a_scene_cannot_become_elements(tmp_path):
    trap = "</script><script>alert(1)</script><img src=x onerror=alert(2)>"
    scene = dataclasses.replace(MAIN, noise=BandNoise(0.04, (0.0, 10.0), 100, trap))
    density = fakes.FakeEvolution(scene, noise_replacement=trap)
    values = density.summary()
    text, page = written(tmp_path / "out.html", density, values, scenes=[scene], sentences=[trap])
    assert text.count("<script") == 3
    assert text.count("<img") == 1
    assert "onerror" not in dict(page.attributes)
    assert trap in page.texts
    assert trap in page.json["summary"]["remarks"]


STAND_IN = """
const elements = {}, drawn = [];
const film = process.argv[2];
function element(id) {
  const pen = { fillStyle: "", font: "", textAlign: "" };
  pen.fillRect = (...box) => drawn.push([pen.fillStyle, ...box]);
  for (const name of ["fillText", "save", "restore", "translate", "rotate"]) pen[name] = () => {};
  const made = { id, value: "0", listeners: {}, attributes: {}, width: 460, height: 360 };
  made.textContent = id === "film" ? require("fs").readFileSync(film, "utf8") : "";
  made.getContext = () => pen;
  made.addEventListener = (name, action) => { made.listeners[name] = action; };
  made.setAttribute = (name, value) => { made.attributes[name] = value; };
  return made;
}
globalThis.document = { getElementById: (id) => (elements[id] ??= element(id)) };
require("vm").runInThisContext(require("fs").readFileSync(process.argv[3], "utf8"));
elements.cycle.value = "4";
drawn.length = 0;
elements.cycle.listeners.input();
console.log(JSON.stringify({ drawn, when: elements.when.textContent, most: elements.most.textContent,
  said: [elements.said0.textContent, elements.said1.textContent], label: elements.film1.attributes["aria-label"] }));
"""


@pytest.mark.skipif(shutil.which("node") is None, reason="needs node")
def test_the_slider_draws_its_cycle(both, tmp_path):
    """In a stand-in of the browser: every bin in its colour and place, what has overturned, and the words."""
    film = both.json["film"]
    (tmp_path / "film.json").write_text(json.dumps(film), encoding="utf-8")
    (tmp_path / "run.js").write_text(STAND_IN, encoding="utf-8")
    asked = [shutil.which("node"), tmp_path / "run.js", tmp_path / "film.json", SCRIPT]
    done = subprocess.run(asked, capture_output=True, text=True, check=True, timeout=60)
    page = json.loads(done.stdout)
    assert page["when"] == "after 4 cycles"
    assert float(page["most"]) == pytest.approx(film["most"][4], rel=1e-2)
    left, right = DENSITY.overturned[4]
    assert page["said"][0] == f"survival {DENSITY.survival[4]:.4f}, overturned left {left:.4f}, right {right:.4f}"
    assert page["label"].startswith("Density after 4 cycles: survival ")
    columns, rows = len(film["angle"]) - 1, len(film["velocity"]) - 1
    per_frame = columns * rows + 3
    assert len(page["drawn"]) == 2 * per_frame
    for n, shown in enumerate(film["films"]):
        boxes = page["drawn"][n * per_frame : (n + 1) * per_frame]
        codes = base64.b64decode(shown["codes"][4])
        assert [box[0] for box in boxes[1:-2]] == [film["colours"][code] for code in codes]
        places = np.array([box[1:] for box in boxes[1:-2]]).reshape(columns, rows, 4)
        assert np.all(np.diff(places[:, 0, 0]) > 0.0)
        assert np.all(np.diff(places[0, :, 1]) < 0.0)
        assert (places[..., :2] >= 0.0).all()
        assert (places[..., 0] + places[..., 2]).max() <= 460
        assert [box[0] for box in boxes[-2:]] == [OVERTURNED] * 2
        heights = [box[4] for box in boxes[-2:]]
        assert heights == pytest.approx(np.array(shown["overturned"][4]) * (360 - 8 - 46))


def run(*arguments):
    """Exit status, standard output and standard error of one command."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        status = cli.main([str(argument) for argument in arguments])
    return status, out.getvalue(), err.getvalue()


@pytest.mark.parametrize("command", ["fpk", "mc", "compare"])
def test_commands_write_it_and_tell_its_size(command, tmp_path):
    scene, path = tmp_path / "scene.toml", tmp_path / "new" / "out.html"
    scene.write_text(MAIN.to_toml(), encoding="utf-8")
    sampled = ["--realizations", "2000", "--method", "rk4"] if command != "fpk" else []
    solved = ["--tol", "1e-2", "--no-check", "--noise-replacement", "white"] if command != "mc" else []
    status, out, err = run(command, scene, "--cycles", "8", *sampled, *solved, "--report", path, "--json")
    assert status == 0
    page = Page(path.read_text(encoding="utf-8"))
    assert page.json["summary"] == json.loads(out)
    assert page.json["summary"]["trust"]["verdict"] == ("ok" if command == "mc" else "caution")
    assert len(page.json["film"]["films"]) == 1 + (command == "compare")
    assert err.splitlines()[-1] == f"fpk-rocking {command}: {path}: {path.stat().st_size / 1000:,.0f} kB"
    assert [file.name for file in path.parent.iterdir()] == ["out.html"]


def test_of_fragility_there_are_curves_and_numbers(tmp_path):
    scene, path = tmp_path / "scene.toml", tmp_path / "out.html"
    scene.write_text(MAIN.to_toml(), encoding="utf-8")
    asked = ["--scales", "0.5,1,2", "--cycles", "2", "--realizations", "400", "--engine", "rk4"]
    status, out, _ = run("fragility", scene, *asked, "--report", path, "--json")
    assert status == 0
    page = Page(path.read_text(encoding="utf-8"))
    values = json.loads(out)
    assert page.json == {"summary": values}
    place = page.rows[0].index("probability")
    assert [float(row[place]) for row in page.rows[1:]] == pytest.approx(values["overturned"][0], rel=1e-5)
    assert any(text.startswith("Lognormal (overturned)") for text in page.texts)


def test_a_report_that_cannot_be_written_is_refused_before_the_work(tmp_path):
    status, _, err = run("fpk", "scene.toml", "--report", tmp_path)
    assert status == 2
    assert f"--report: got the folder {str(tmp_path)!r}, accepted: a file to write" in err
    (tmp_path / "file").touch()
    status, _, err = run("fpk", "scene.toml", "--report", tmp_path / "file" / "out.html")
    assert (status, "--report: got the file" in err) == (2, True)
