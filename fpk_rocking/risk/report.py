"""Report and picture of a risk study: block, motions, curve with its records, hazard, contributions to the rate."""

import html
import importlib.metadata
import math
import textwrap
from collections.abc import Sequence
from typing import Any

import numpy as np

from fpk_rocking.base.checks import File, not_none
from fpk_rocking.output.report import json_html, left_out, table_html, write_page
from fpk_rocking.physics.forcing import Record
from fpk_rocking.results import pictures
from fpk_rocking.results.pictures import figure_of, picture_html
from fpk_rocking.results.remarks import noise_text
from fpk_rocking.risk.anchor import lift_off_g
from fpk_rocking.risk.motions import intensity_of, motion_lines, motion_names
from fpk_rocking.risk.picture import draw_contributions, draw_curve
from fpk_rocking.risk.rate import number_text, rate_text
from fpk_rocking.scene.parts import LENGTHS
from fpk_rocking.scene.scene import Scene
from fpk_rocking.scene.units import STANDARD_GRAVITY, Dimensions

_CITE = (
    "fpk-rocking, version {version}: densities and ensembles of rocking blocks under noisy periodic excitation. The "
    "model is that of H. Lin and S. C. S. Yim, Nonlinear rocking motions. I: Chaos under noisy periodic excitations, "
    "J. Eng. Mech. 122(8), 719-727, 1996; the restitution of a block that gives none, G. W. Housner, Bull. Seism. Soc. "
    "Am. 53(2), 403-417, 1963; the fit, J. W. Baker, Earthquake Spectra 31(1), 579-599, 2015."
)
_LEFT = (
    "The dispersion contains the sources that are listed and no others: neither that of the hazard, nor of the model "
    "of the block, nor of values of the block that were not declared uncertain "
    "(--uncertain, as in --uncertain block.restitution_factor=uniform:0.93:1)."
)


_LINE = 32
"""Letters of the name of a motion beside its picture that stand on a line."""


def write_risk_report(path: File, study: Any, command: str = "") -> int:
    """Write the report of a study of risk as one HTML file, complete or not at all."""
    risk, curve, scenes = study.risk, study.curve, study.motions
    title = f"{study.name}: {study.title}"
    # The table of the motions says the same.
    lines = [*motion_lines(study.table(), curve.measure), study.about_critical, study.about_correction]
    lines += study.block_lines
    first, *words = (text for text in study.text().splitlines() if not text.startswith("trust: "))
    parts = [
        f"<p>{html.escape(_untitled(first, study.title))}</p>",
        f"<p>{html.escape(study.about_correction)}</p>" * bool(study.about_correction),
        study.trust.html,
        *[table_html(_asked(study))] * bool(study.asked.size),
        f"<p>{html.escape(' '.join(study.block_sentences))}</p>",
        f"<h2>P({html.escape(curve.name)})</h2>",
        _picture(lambda _, axes: draw_curve(axes, curve, study.records), "Probability against intensity"),
        "".join(f"<p>{html.escape(text)}</p>" for text in words if text not in lines),
        _sources(curve),
        table_html(_points(curve)),
        *(_hazard(risk) if risk else ()),
        "<h2>Block</h2>",
        _block(study.scene, study.draws),
        "<h2>Motions</h2>",
        f"<p>{_motions_text(study)}</p>",
        _folded_motions(study.recorded, _motions(study), study.about_critical),
        "<h2>What is left out</h2>",
        f"<p>{html.escape(left_out(scenes, scatter=not _scatters(study.draws)))} {_LEFT}</p>",
        "<h2>How it was made</h2>",
        f"<p>{html.escape(study.origin(command))}</p>",
        "<h2>How to cite</h2>",
        f"<p>{html.escape(_CITE.format(version=importlib.metadata.version('fpk-rocking')))}</p>",
        f"<details><summary>Scene but for its motions</summary><pre>{_without_forcing(study.scene)}</pre></details>",
        json_html("summary", study.summary()),
    ]
    return write_page(path, title, parts)


def write_designs_report(path: File, designs: Any, command: str = "") -> int:
    """Write the report of several blocks under the same motions as one HTML file, complete or not at all."""
    first, unit = designs.studies[0], designs.studies[0].curve.unit
    table: dict[str, list[str]] = {"block": [one.name for one in designs.studies]}
    heads = "annual rate", "low (95 %)", "high (95 %)"
    for name, column in zip(heads, zip(*designs.rate_texts, strict=True), strict=True):
        table[name] = list(column)
    for name, head in (("median", f"median, {unit}"), ("dispersion", "dispersion")):
        table[head] = _digits(getattr(one.curve.fit, name) for one in designs.studies).tolist()
    table["lifts off at, g"] = [f"{lift_off_g(one.scene.block):.3g}" for one in designs.studies]
    motions = {
        name: column if column.dtype.kind == "U" else _digits(column) for name, column in designs.table().items()
    }
    parts = [
        *(f"<p>{html.escape(text)}</p>" for text in designs.sentences),
        designs.trust.html,
        table_html({name: np.array(column) for name, column in table.items()}),
        picture_html(designs.plot(), "Curves of all blocks, and ratios of their equivalent intensities", dots=150),
    ]
    for one in designs.studies:
        parts += [
            f"<h2>{html.escape(one.name)}</h2>",
            f"<p>{html.escape(one.title[0].upper() + one.title[1:])}.</p>",
            one.trust.html,
            *[table_html(_asked(one))] * bool(one.asked.size),
            f"<p>{html.escape(' '.join(one.block_sentences))}</p>",
            _block(one.scene, one.draws),
            f"<p><a href='{html.escape(one.name)}/report.html'>All of {html.escape(one.name)}</a></p>",
        ]
    parts += [
        "<h2>Motions</h2>",
        f"<p>{_motions_text(first)}</p>",
        _folded_motions(first.recorded, motions, designs.about_motions),
        f"<p>{html.escape(left_out([one.scene for one in designs.studies]))} {_LEFT}</p>",
        f"<p>{html.escape(first.origin(command))}</p>",
        json_html("summary", designs.summary()),
    ]
    return write_page(path, designs.title[0].upper() + designs.title[1:], parts)


def _asked(study):
    """Return a dict of columns, arrays of texts (n,) by their heads, at the intensities that a `Study` was asked."""
    curve, columns = study.curve, list(study.at_asked.values())
    names = (
        f"{curve.measure}, {curve.unit}",
        f"P({curve.name})",
        "low (95 %)",
        "high (95 %)",
        "P in files",
        "peak up to, g",
    )
    table = {name: _digits(column) for name, column in zip(names, columns, strict=False)}
    ties = zip(study.tie, columns[-2:], strict=True)
    return table | {f"tie {where}": np.array(list(map(study.force_text, column))) for where, column in ties}


def _scatters(draws):
    """Whether the restitution was drawn from a distribution, by the `Draws` of a study, or None (bool)."""
    return draws is not None and any(name.startswith("block.restitution") for name in draws.values)


def _folded_motions(scenes, columns, about):
    """Return picture and table of the motions of scenes, with a text about its columns, as HTML to be unfolded."""
    picture = _picture(lambda figure, axes: draw_motions(axes, scenes, figure), "Accelerations of the motions")
    table = f"{table_html(columns)}<p>{html.escape(about)}</p>{picture}"
    return f"<details><summary>Each motion: table and picture</summary>{table}</details>"


def _picture(panel, meaning):
    """Return a picture as HTML text, drawn by `panel`, a function of a figure and its axes."""
    return picture_html(figure_of(panel), meaning, dots=150)


def _hazard(risk):
    """Yield heading, picture, and law and table of the hazard of a `Risk`, texts of HTML."""
    yield "<h2>Hazard and risk</h2>"
    yield _picture(lambda _, axes: draw_contributions(axes, risk), "Contributions to the rate, and the hazard")
    measure, hazard = f"{risk.curve.measure}, {risk.curve.unit}", risk.hazard
    table = {measure: _digits(hazard.intensity), "exceeded, 1/year": np.array(list(map(rate_text, hazard.rate)))}
    law = f"<p>Exceeded {hazard.law} times a year (im in {risk.curve.unit}).</p>"
    if hazard.law:
        yield law
    if hazard.source or not hazard.law:
        yield table_html(table)


def _untitled(text, title):
    """Return a sentence `text` without the `title` of the page that it begins with, with a capital letter."""
    rest = text.removeprefix(title).lstrip(":. ")
    return rest[0].upper() + rest[1:]


def _without_forcing(scene):
    """Return the text of a scene in HTML without its forcing, which the motions of a study replace."""
    parts = scene.to_toml().split("\n\n")
    return html.escape("\n\n".join(part for part in parts if not part.startswith("[forcing")))


def _block(scene, draws):
    """Return a text of HTML: the sketch of the block of a scene, its figures, and what of it is uncertain."""
    size = scene.block.size
    if isinstance(size, Dimensions):
        own = size.width <= size.height and math.isclose(scene.block.restitution, size.restitution, rel_tol=1e-12)
        lengths = {"width": size.width, "height": size.height}
    else:
        own, lengths = False, {name.replace("_", " "): getattr(size, name) for name in LENGTHS}
    rows = {name: f"{value:.4g} m" for name, value in lengths.items()} | {
        "critical angle θ_cr": f"{math.degrees(size.critical_angle):.4g}°",
        "frequency parameter p": f"{size.frequency_parameter:.4g} rad/s",
        "restitution": f"{scene.block.restitution_text('.4g')}{', Housner' * own}",
        "lifts off at": f"{lift_off_g(scene.block):.4g} g",
        "overturned at": f"{math.degrees(scene.overturning.angle * size.critical_angle):.4g}°, "
        f"{scene.overturning.angle:.3g} θ_cr",
        "rocks, and does not slide first": f"friction of at least {scene.block.least_friction:.3g}",
    }
    for name, values in ({} if draws is None else draws.values).items():
        rows[f"uncertain {name.replace('_', ' ')}"] = f"{min(values):.3g} to {max(values):.3g}"
    table = "".join(f"<tr><th>{html.escape(name)}</th><td>{html.escape(text)}</td></tr>" for name, text in rows.items())
    return f"<div class='films'>{_sketch(size)}<table>{table}</table></div>"


def _sketch(size):
    """Return a drawing (SVG, as a text) of the block on its base with its width, height and critical angle."""
    if isinstance(size, Dimensions):
        width, height, right, left = size.width, size.height, 0.5 * size.width, None
    else:
        width, height, right, left = size.left + size.right, 2.0 * size.height_of_centre, size.right, size.left
    easy = left is not None and left < right
    factor = 150.0 / max(width, height)
    w, h, outline = factor * width, factor * height, "" if left is None else " stroke-dasharray='2 4'"
    x, y, line = 40.0, 15.0, "stroke='#222' stroke-width='1.5'"
    text = "font-family='sans-serif' font-size='12' fill='#222'"
    middle, centre = x + w - factor * right, y + 0.5 * h
    corner = x if easy else x + w
    below = f"{width:.3g} m" if left is None else f"{left:.3g} m | {right:.3g} m"
    beside = f"{height:.3g} m" if left is None else f"{0.5 * height:.3g} m"
    angle = f"θ_cr = {math.degrees(size.critical_angle):.3g}°"
    return (
        f"<svg width='{w + 150:.0f}' height='{h + 60:.0f}' role='img' aria-label='The block'>"
        f"<rect x='{x:.1f}' y='{y:.1f}' width='{w:.1f}' height='{h:.1f}' fill='#dbe7f0' {line}{outline}/>"
        f"<line x1='10' x2='{x + w + 90:.1f}' y1='{y + h:.1f}' y2='{y + h:.1f}' stroke='#222' stroke-width='3'/>"
        f"<line x1='{corner:.1f}' y1='{y + h:.1f}' x2='{middle:.1f}' y2='{centre:.1f}' {line} stroke-dasharray='4 3'/>"
        f"<circle cx='{middle:.1f}' cy='{centre:.1f}' r='3' fill='#222'/>"
        f"<text x='{middle:.1f}' y='{y + h + 20:.1f}' text-anchor='middle' {text}>{below}</text>"
        f"<text x='{x + w + 8:.1f}' y='{centre:.1f}' {text}>{beside}</text>"
        f"<text x='{x + w + 8:.1f}' y='{y + h - 8:.1f}' {text}>{angle}</text></svg>"
    )


def _motions_text(study):
    """Return number of motions, noise, paths and seed of a `Study`, as sentences in HTML."""
    count, curves = len(study.motions), study.fragility
    shaken = "it is scaled with the motion" if curves.noise_scaled else "it is not scaled with the motion"
    first = study.motions[0]
    text = f"{count} motion{'s' * (count > 1)}, each scaled to each intensity. "
    text += (
        f"Random acceleration added to motion 1 at intensity 1: {_noise(first)}; {shaken}. "
        if first.noise.kind != "none"
        else ""
    )
    text += f"{curves.realizations:,} paths of each motion at each intensity. " if first.noise.kind != "none" else ""
    random = first.noise.kind != "none" or study.draws is not None
    return html.escape(text + f"Seed {curves.options['seed']}." * random)


def _noise(scene):
    """Return the noise of a scene as a text, that of a band in g and Hz."""
    size, noise = scene.block.size, scene.noise
    if noise.kind != "band":
        return f"{noise_text(noise)} (nondimensional)"
    rms = math.sqrt(noise.variance) * size.gravity * size.critical_angle / STANDARD_GRAVITY
    low, high = (frequency / size.frequency(1.0) for frequency in noise.band)
    shape = "" if noise.envelope is None else f", envelope {noise.envelope} (nondimensional)"
    return f"band noise, rms {rms:.3g} g, {low:.3g} to {high:.3g} Hz, {noise.harmonics} harmonics{shape}"


def _motions(study):
    """Return a dict of columns, arrays (m,) by their heads, of the motions of a `Study` as they are."""
    table, curve = study.table(), study.curve
    lasting = [scene.block.size.seconds(scene.forcing.duration) for scene in study.recorded]
    names = {"pga_g": "PGA, g", "pgv_m_per_s": "PGV, m/s", "pgv_as_recorded_m_per_s": "PGV as recorded, m/s"}
    names |= {"vertical": "vertical", "vertical_pga_g": "vertical PGA, g"}
    names |= {"pfa_g": "PGA on the floor, g", "overturn_s": "overturns, s", "overturn_side": "to the"}
    names |= {
        "peak_rotation": "largest |θ| over the critical angle",
        "critical_scale": f"factor at critical {curve.measure}",
    }
    unit = f"{curve.measure}, {curve.unit}"
    names |= {"critical_intensity": f"critical {unit}", "always_intensity": f"always from {unit}"}
    names["equivalent_intensity"] = f"equivalent {unit}"
    if curve.measure not in ("PGA", "PGV"):
        names["own_intensity"] = unit
    events = [getattr(scene.forcing, "event", "") for scene in study.recorded]
    named = [", ".join(filter(None, pair)) for pair in zip(table["motion"].tolist(), events, strict=True)]
    head = {"motion": np.array(named), "seconds": _digits(lasting)}
    if "critical_scale" not in table:
        ends = [curve.intensity[[0, -1]] / intensity_of(scene, curve.measure) for scene in study.recorded]
        head["factors"] = np.array([f"{low:.3g} to {high:.3g}" for low, high in ends])
    kept = {text: table[name] for name, text in names.items() if name in table}
    return head | {
        text: values if values.dtype.kind == "U" else np.where(np.isinf(values), "none", _digits(values))
        for text, values in kept.items()
    }


def _sources(curve):
    """Return the table of the dispersion of each source of an `IntensityCurve`, as a text of HTML."""
    sources, errors = curve.sources | {"all": curve.fit.dispersion}, [*curve.source_errors.values(), math.nan]
    columns = {"source": np.array(list(sources)), "dispersion": _digits(sources.values())}
    return table_html(columns | {"standard error": _digits(errors)})


def _points(curve):
    """Return a dict of columns, arrays of texts (n,) by their heads, of the points of an `IntensityCurve`."""
    names = [f"{curve.measure}, {curve.unit}", "mean of the motions", "low (95 %)", "high (95 %)"]
    names += ["lognormal", "its low (95 %)", "its high (95 %)"]
    columns = curve.table().values()
    return {name: _digits(column) for name, column in zip(names, columns, strict=True)}


def _digits(values):
    """Return numbers (n,) as an array of their texts."""
    return np.array(list(map(number_text, values)))


def risk_figure(path: File, study: Any) -> None:
    """Draw a study as a page: the curve with its motions, and where there is a hazard the contributions to the rate."""
    risk, title = study.risk, f"{study.title[0].upper()}{study.title[1:]}"
    notes = list(risk.sentences) if risk else [study.curve.describe()]
    if study.trust.verdict != "ok":
        notes.insert(0, f"Verdict: {study.trust.verdict}. The report says why.")
    with pictures.page(path, (11.0 if risk else 6.5, 5.2), title, notes) as figure:
        left, *right = np.atleast_1d(figure.subplots(1, 2 if risk else 1))
        draw_curve(left, study.curve, study.records)
        if risk:
            draw_contributions(right[0], risk)
            left.set_title(f"(a) P({study.curve.name})")
            right[0].set_title("(b) Where the rate comes from")


def draw_motions(axes: Any, scenes: Sequence[Scene], figure: Any = None) -> None:
    """Draw the acceleration of each motion against time, one above the other, each in parts of its own peak."""
    motions = [scene for scene in scenes if scene.block.size is not None]
    peaks = [intensity_of(scene, "PFA") for scene in motions]
    named = zip(motion_names(motions), peaks, strict=True)
    names = ["\n".join([*textwrap.wrap(name, _LINE), f"{peak:.3g} g"]) for name, peak in named]
    if figure is not None:
        lines = max((name.count("\n") for name in names), default=0)
        figure.set_size_inches(7.0, 1.0 + (0.3 + 0.12 * lines) * len(motions))
    for place, scene in enumerate(motions):
        motion, size = scene.forcing, not_none(scene.block.size)
        span = motion.duration if np.isfinite(motion.duration) else 5.0 * motion.time_scale
        # The samples of a record themselves: another grid cuts peaks.
        if isinstance(motion, Record):
            times, force = motion.unit * np.arange(len(motion.samples)), motion.forces
        else:
            times = np.linspace(0.0, span, 2000)
            force = np.array([motion.value(time) for time in times])
        axes.plot(size.seconds(times), 0.5 * force / motion.largest - place, color=pictures.COLOURS[0], linewidth=0.5)
    axes.set(xlabel="time, s", ylim=(0.4 - len(motions), 0.6))
    axes.set_yticks([-place for place in range(len(motions))], names, fontsize=7)
    axes.set_title("Each motion in parts of its own peak", fontsize=9)
    axes.grid(visible=False, axis="y")
