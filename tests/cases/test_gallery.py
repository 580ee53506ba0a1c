"""The gallery: every case has its pictures in it, and reduced pictures keep size and colours within bounds."""

import importlib.util
import json
import pathlib
import re

import numpy as np
import pytest
from PIL import Image, PngImagePlugin

from fpk_rocking.results import pictures

ROOT = pathlib.Path(__file__).parents[2]
SPEC = importlib.util.spec_from_file_location("gallery", ROOT / "cases" / "gallery.py")
gallery = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(gallery)


def test_every_case_is_in_it():
    cases = {path.stem for path in (ROOT / "cases").glob("*.py")} - {"command", "gallery", "motion", "opengl", "view"}
    assert set(gallery.PICTURES) == cases
    for name, drawn in gallery.PICTURES.items():
        text = (ROOT / "cases" / f"{name}.py").read_text(encoding="utf-8")
        assert all(f"``{picture}``" in text for picture in drawn), name
        assert len(text.partition("\n")[0]) <= 3 + 50, f"{name}: the title has to fit the navigation of the site"


def test_gallery_holds_these_pictures_and_the_documents_show_no_others():
    kept = {name for drawn in gallery.PICTURES.values() for name in drawn.values()}
    kept |= {gallery.numbers_of(name) for name in gallery.PICTURES}
    files = list((ROOT / "docs" / "gallery").iterdir())
    assert {path.name for path in files} == kept
    assert max(path.stat().st_size for path in files) <= gallery.LARGEST
    for path in files:
        if path.suffix == ".json":
            assert json.loads(path.read_text(encoding="utf-8"))
            continue
        with Image.open(path) as picture:
            assert gallery.title_of(picture), f"{path.name}: a title that says what the picture shows"
    for document in (ROOT / "README.md", *(ROOT / "docs").glob("*.md")):
        shown = re.findall(r"\]\((?:docs/)?gallery/([^)]+)\)", document.read_text(encoding="utf-8"))
        assert set(shown) <= kept, document


@pytest.mark.parametrize(("largest", "width"), [(gallery.LARGEST, gallery.WIDTHS[0]), (1000, gallery.WIDTHS[-1])])
def test_reduced_pictures_keep_their_lines_and_titles(tmp_path, largest, width):
    """A thin line keeps its colour beside a field of many; what palettes cannot make small enough loses pixels."""
    pixels = np.empty((900, 1500, 3), dtype=np.uint8)
    pixels[:] = np.linspace(90, 255, 1500)[None, :, None]
    line = tuple(int(pictures.COLOURS[1][place : place + 2], 16) for place in (1, 3, 5))
    pixels[400:406] = line
    about = PngImagePlugin.PngInfo()
    about.add_itxt("Title", "σ falls")
    Image.fromarray(pixels).save(tmp_path / "large.png", pnginfo=about)
    gallery.reduce(tmp_path / "large.png", tmp_path / "small.png", largest)
    with Image.open(tmp_path / "small.png") as image:
        assert (image.mode, image.width, gallery.title_of(image)) == ("P", width, "σ falls")
        pixels = np.asarray(image.convert("RGB")).astype(int)[round(402.5 / 900 * image.height)]
    assert np.abs(pixels - line).max() < 12
    assert {path.name for path in tmp_path.iterdir()} == {"large.png", "small.png"}


def test_cases_are_run_into_folders_of_their_own(tmp_path, monkeypatch):
    """A case draws anew in another colour from the numbers that its run left in the gallery."""
    source = "def draw(path, values):\n    Image.new('RGB', (9, 9), values['two'][0]).save(path)\n\n\n"
    source += "def run(out):\n    out.mkdir(parents=True)\n    Image.new('RGB', (9, 9)).save(out / 'a.png')\n"
    source += '    (out / \'a.json\').write_text(\'{"one": [1.5,\\n2], "two": ["red", "σ"]}\', encoding=\'utf-8\')\n'
    (tmp_path / "made.py").write_text(f"from PIL import Image\n\n\n{source}")
    monkeypatch.syspath_prepend(tmp_path)
    cases = {"made": {"a.png": "b.png"}}
    seconds = gallery.run(tmp_path / "pictures", tmp_path / "results", cases)
    assert list(seconds) == ["made"]
    assert {path.name for path in (tmp_path / "pictures").iterdir()} == {"b.png", "b.json"}
    numbers = (tmp_path / "pictures" / "b.json").read_text(encoding="utf-8")
    assert numbers == '{\n"one": [1.5, 2],\n"two": ["red", "σ"]\n}\n'
    assert (tmp_path / "results" / "made" / "a.png").exists()
    gallery.run(tmp_path / "pictures", tmp_path / "results", cases, redraw=True)
    with Image.open(tmp_path / "pictures" / "b.png") as drawn:
        assert drawn.convert("RGB").getpixel((4, 4)) == (255, 0, 0)
    assert (tmp_path / "pictures" / "b.json").read_text(encoding="utf-8") == numbers


def test_cases_drawn_from_numbers_ask_for_no_more():
    assert set(gallery.DRAWN_FROM_NUMBERS) <= set(gallery.PICTURES)
    for name in gallery.DRAWN_FROM_NUMBERS:
        assert len(gallery.PICTURES[name]) == 1
        assert "\ndef draw(path, values):\n" in (ROOT / "cases" / f"{name}.py").read_text(encoding="utf-8"), name


def test_the_gallery_page_says_of_every_picture_what_its_title_does_not():
    """What draws no picture need not run for the page: `python cases/gallery.py --redraw` writes it too."""
    docs = ROOT / "docs"
    page = (docs / "gallery.md").read_text(encoding="utf-8")
    assert page == gallery.shown(docs)
    assert set(gallery.PARTS) <= set(gallery.PICTURES)
    shown = re.findall(r"\]\(((?:gallery|benchmarks)/\w+\.png)\)\]\(.*\)\n\n\*(.*)\.\*", page)
    assert len(shown) == page.count(".png")
    for path, caption in shown:
        with Image.open(docs / path) as picture:
            assert gallery.title_of(picture) != caption, path
