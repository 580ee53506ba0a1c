"""A run or a comparison as one HTML file: numbers, verdict, pictures, densities to slide through.

Nothing in it is loaded from anywhere, and a policy in the file forbids it to the browser.
"""

import base64
import html
import importlib.metadata
import json
import math
import pathlib
import re

import numpy as np

from fpk_rocking.results.pictures import OVERTURNED, SURFACE, edges_of, picture_html, plane_units
from fpk_rocking.results.storage import write_text

__all__ = ["json_html", "left_out", "table_html", "write_page", "write_report"]

_FRAMES = 121

_LEFT_OUT = (
    "The model is one rigid block that rocks in a plane on a rigid base{slender}. It leaves out sliding, a vertical "
    "motion of the base that is not given, motion in three dimensions, anchorage{centre}, flexible "
    "bases and contents{scatter}. No error stated here contains these."
)
_FILM = (
    "Colours: probability in a bin divided by its area. Bars at the sides: probability of having overturned to that "
    "side, 1 at full height. The arrow keys move the slider, too."
)
_NUMBER = re.compile(r"(none|-|-?[\d.,]+(e[+-]?\d+)?([ –].*)?)?")
"""A cell of a table that holds a number, with its unit or another number behind it."""

_HERE = pathlib.Path(__file__).parent


def write_report(path, result, values, sentences=(), films=(), scenes=()):
    """Write a report on a `Result` as an HTML file, whole or not at all; returns its size in bytes.

    `values` are kept in the file as JSON under the id "summary". `sentences` stand below the table, the verdict aside.
    `films` are results whose densities are shown after every cycle they have in common, of more than 121 cycles as many
    of them. `scenes` are listed at the end.
    """
    film = _film(films) if films else None
    script = (_HERE / "report.js").read_text(encoding="utf-8")
    parts = [
        result.trust.html,
        picture_html(result.plot(), result.title),
        _film_html(film) if film else "",
        "<h2>Numbers</h2>",
        table_html(result.table()),
        *(f"<p>{html.escape(sentence)}</p>" for sentence in sentences if sentence != str(result.trust)),
        "<h2>Scene</h2>" * bool(scenes),
        *(f"<pre>{html.escape(text)}</pre>" for text in dict.fromkeys(map(_without_samples, scenes))),
        f"<p>{left_out(scenes)}</p>",
        f"<p class='small'>fpk-rocking {html.escape(importlib.metadata.version('fpk-rocking'))}. {_units(scenes)}</p>",
        json_html("summary", values),
        f"{json_html('film', film)}<script>{script}</script>" if film else "",
    ]
    return write_page(path, result.heading, parts)


def write_page(path, title, parts):
    """Write a page of HTML, of a title and parts below it, that needs nothing else; returns its size in bytes."""
    page = (_HERE / "report.html").read_text(encoding="utf-8").replace("<!--TITLE-->", html.escape(title))
    page = page.replace("<!--BODY-->", "\n".join(parts))
    write_text(path, page)
    return len(page.encode())


def _without_samples(scene):
    """TOML text of a scene with the number of samples of a record in place of these."""
    lines = scene.to_toml().splitlines()
    short = (f"# {line.count(',') + 1:,} samples" if line.startswith("samples = ") else line for line in lines)
    return "\n".join(short)


def _units(scenes):
    """Sentences on the units of numbers beside which no unit stands."""
    units = "Unless a unit stands beside them, angles are in units of the critical angle and times are τ = pt."
    sizes = list(dict.fromkeys(scene.block.size for scene in scenes if scene.block.size is not None))
    if len(sizes) != 1:
        return units
    angle, second = math.degrees(sizes[0].critical_angle), sizes[0].seconds(1.0)
    return f"{units} Here the critical angle is {angle:.4g}°, and τ = 1 is {second:.4g} s."


def left_out(scenes, *, scatter=True):
    """Return the effects that the model leaves out for some scenes; `scatter`: that of restitution among them."""
    slender = [scene.block.critical_angle == 0.0 for scene in scenes]
    which = "" if all(slender) else f" in {sum(slender)} of {len(slender)} scenes"
    bodies = all(scene.block.body is not None for scene in scenes)
    return _LEFT_OUT.format(
        centre="" if bodies else ", a centre of gravity above half the height",
        slender=f", with the equation of motion of a slender one{which}" if any(slender) else "",
        scatter=", and the scatter of restitution" * scatter,
    )


def table_html(columns):
    """Return the table of columns (n,) by name as HTML, without those that are empty or unknown throughout."""
    texts = {name: [_text(value) for value in np.asarray(column).tolist()] for name, column in columns.items()}
    texts = {name: column for name, column in texts.items() if any(column)}
    left = [_look(column) for column in texts.values()]
    heads = zip(left, map(_column_label, texts), strict=True)
    head = "".join(f"<th{look}>{html.escape(label)}</th>" for look, label in heads)
    rows = (
        "".join(f"<td{look}>{html.escape(text)}</td>" for look, text in zip(left, row, strict=True))
        for row in zip(*texts.values(), strict=True)
    )
    return f"<div class='wide'><table><tr>{head}</tr>{''.join(f'<tr>{row}</tr>' for row in rows)}</table></div>"


def _look(column):
    """Class of the cells of a column, texts, as HTML: none for numbers, "word" for short texts, else "text"."""
    if all(map(_NUMBER.fullmatch, column)):
        return ""
    return f" class='{'text' if max(map(len, column)) > 12 else 'word'}'"


def _column_label(name):
    """Head of a column whose name may end with its unit: "pgv, m/s" for "pgv_m_per_s"."""
    units = {"_m_per_s": ", m/s", "_s": ", s", "_g": ", g", "_deg": ", degrees"}
    ending = next((ending for ending in units if name.endswith(ending)), "")
    words = "time τ" if name == "time" else name.removesuffix(ending).replace("_", " ")
    return words + units.get(ending, "")


def _text(value):
    """A value of a table as a text; empty for a float that is not finite."""
    if isinstance(value, float):
        return f"{value:.6g}" if np.isfinite(value) else ""
    return str(value)


def json_html(name, values):
    """Return an element of HTML with the id `name` that holds plain values as JSON.

    "<" is written so that no text of theirs can end the element.
    """
    text = json.dumps(values, allow_nan=False, ensure_ascii=False).replace("<", "\\u003c")
    return f"<script type='application/json' id='{name}'>{text}</script>"


def _film(results):
    """Data of the animation of some `SurvivalResult`, as plain values.

    For each result and cycle they are codes 0 to 255 of the root of the density in bins. Codes are on one scale for all
    results after a cycle, from 0 to the largest density there, "most".
    """
    import matplotlib as mpl

    rows = min(len(result.times) for result in results)
    rows = np.unique(np.linspace(0, rows - 1, min(rows, _FRAMES)).astype(int)).tolist()
    cycles = [results[0].cycle_of(row) for row in rows]
    edges = edges_of(results, cycles)
    areas = np.multiply.outer(*map(np.diff, edges))
    densities = [[result.bin_probabilities(cycle, *edges) / areas for cycle in cycles] for result in results]
    densities = np.maximum(densities, 0.0)
    units = plane_units(results[0].scene)
    most = densities.max(axis=(0, 2, 3))
    lists, scales = [], np.maximum(most, np.finfo(float).tiny)[:, None, None]
    for result, frames in zip(results, densities, strict=True):
        codes = np.round(255 * np.sqrt(frames / scales)).astype(np.uint8)
        lists.append(
            {
                "name": result.label,
                "survival": np.asarray(result.survival)[rows].tolist(),
                "overturned": np.asarray(result.overturned)[rows].tolist(),
                "codes": [base64.b64encode(frame.tobytes()).decode("ascii") for frame in codes],
            }
        )
    first = results[0]
    standing = np.flatnonzero(np.asarray(first.survival)[rows] > 1e-3)
    return {
        "when": [first.when(row) for row in rows],
        "angle": (edges[0] * units.angle).tolist(),
        "velocity": (edges[1] * units.velocity).tolist(),
        "names": units.names,
        "most": (most / (units.angle * units.velocity)).tolist(),
        "begin": int(max(standing, default=0)),
        "colours": [mpl.colors.to_hex(colour) for colour in mpl.colormaps[SURFACE](np.linspace(0.0, 1.0, 256))],
        "overturned": OVERTURNED,
        "films": lists,
    }


def _film_html(film):
    """Elements that the script draws densities into, with the slider of their rows."""
    drawings = "".join(
        f"<figure><figcaption>{html.escape(film_of['name'])}</figcaption>"
        f"<canvas id='film{n}' width='460' height='360' role='img' aria-label=''></canvas>"
        f"<p id='said{n}'></p></figure>"
        for n, film_of in enumerate(film["films"])
    )
    shades = ",".join(film["colours"][::32])
    return (
        "<h2>Density</h2>"
        f"<p>{_FILM}</p>"
        "<noscript><p>Scripts are off in this browser, so the densities after each cycle are not shown.</p></noscript>"
        f"<label>cycle or time <input id='cycle' type='range' min='0' max='{len(film['when']) - 1}' step='1' "
        f"value='{film['begin']}'></label> <output id='when' for='cycle'></output>"
        f"<div class='films'>{drawings}</div>"
        f"<p>0 <span class='shades' style='background:linear-gradient(to right,{shades})'></span> "
        "<span id='most'></span> "
        "(square root scale, its top set anew for each cycle)</p>"
    )
