"""Pictures: a page of panels with its title and notes, and a figure in a notebook."""

import io

from PIL import Image

from fpk_rocking.results import pictures


def test_notes_are_wrapped_to_the_width_of_the_page(tmp_path):
    path, notes = tmp_path / "page.png", ["word " * 100, "next"]
    with pictures.page(path, (10.0, 3.0), "Title", notes) as figure:
        figure.subplots()
    assert path.is_file()
    assert figure.get_size_inches().tolist() == [10.0, 3.0]
    assert figure.get_suptitle() == "Title"
    *lines, last = figure.get_supxlabel().split("\n")
    assert last == "next"
    assert 120 < max(map(len, lines)) <= 130
    with pictures.page(path, (4.0, 3.0), "Title") as figure:
        figure.subplots()
    assert not figure.get_supxlabel()


def test_a_notebook_shows_a_picture_without_a_magic_line():
    """IPython asks the last value of a cell for its PNG."""
    figure = pictures.figure_of(lambda _, axes: axes.plot([0, 1]))
    with Image.open(io.BytesIO(figure._repr_png_())) as picture:
        assert picture.format == "PNG"
        assert picture.width > 300
