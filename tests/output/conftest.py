"""What the tests of pictures share."""

import pytest

from fpk_rocking.results import pictures


@pytest.fixture
def drawn(monkeypatch):
    """The figures that are saved, in a list that grows."""
    saved, save = [], pictures.save
    monkeypatch.setattr(pictures, "save", lambda figure, path: saved.append(figure) or save(figure, path))
    return saved
