"""What the report of a risk says of its motions and draws of its block."""

import re
import types

import pytest

from fpk_rocking import BandNoise, Block, Dimensions, Harmonic, NoNoise, Scene
from fpk_rocking.risk import report

SIZE = Dimensions(0.6, 2.0)


def text_of(*noises, scaled=False):
    motions = [Scene(Block(0.9, SIZE), Harmonic(1.0, 2.0), noise) for noise in noises]
    found = types.SimpleNamespace(noise_scaled=scaled, realizations=1200, options={"seed": 7})
    return report._motions_text(types.SimpleNamespace(motions=motions, fragility=found))


def test_the_noise_that_is_named_is_that_of_the_first_motion():
    strong, weak = (BandNoise(variance, (0.0, 9.0), 20) for variance in (0.04, 0.01))
    rms = SIZE.gravity * SIZE.critical_angle / 9.80665
    one, two, quiet = text_of(weak, scaled=True), text_of(strong, weak), text_of(NoNoise())
    assert one.startswith("1 motion, each scaled")
    assert f"rms {0.1 * rms:.3g} g" in one
    assert "it is scaled with the motion. 1,200 paths of each motion at each intensity, seed 7." in one
    assert two.startswith("2 motions, each scaled")
    assert f"rms {0.2 * rms:.3g} g" in two
    assert "it is not scaled with the motion" in two
    assert quiet == "1 motion, each scaled to each intensity. seed 7."


@pytest.mark.parametrize("size", [(0.6, 2.0), (2.0, 0.6), (1.0, 1.0)])
def test_the_sketch_has_the_proportions_and_the_figures_of_the_block(size):
    drawn = report._sketch(Dimensions(*size))
    x, y, w, h = map(float, re.search(r"<rect x='(.*?)' y='(.*?)' width='(.*?)' height='(.*?)'", drawn).groups())
    assert (w, h) == pytest.approx([150.0 * one / max(size) for one in size], abs=0.06)
    line = re.search(r"<line x1='(.*?)' y1='(.*?)' x2='(.*?)' y2='(.*?)'", drawn.partition("stroke-width='3'/>")[2])
    corner, centre = [float(one) for one in line.groups()[:2]], [float(one) for one in line.groups()[2:]]
    assert corner == pytest.approx([x + w, y + h], abs=0.11)
    assert centre == pytest.approx([x + 0.5 * w, y + 0.5 * h], abs=0.11)
    width, height = (float(one) for one in re.search(r"<svg width='(\d+)' height='(\d+)'", drawn).groups())
    assert x + w < width
    assert y + h + 20.0 < height
    for figure in (f"{size[0]:.3g} m", f"{size[1]:.3g} m", f"α = {Dimensions(*size).critical_angle * 57.29578:.3g}°"):
        assert f">{figure}</text>" in drawn
