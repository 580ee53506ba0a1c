"""Look around in a density, with a slider.

    python cases/view.py results/fig06
    python cases/view.py results/fig06 --series jpdf_paths
    python cases/view.py results/fig06 --cycle 4 --screenshot density.png

The surface goes through the mean densities over the elements of the mesh (the bins, for an ensemble), in angle and
velocity, nondimensional; its height is scaled anew at each cycle. The walls at the cut-off are the probabilities that
have overturned to either side, on a scale whose top is the peak. A start from a point is drawn as a needle.

ParaView opens the same .pvd file; there the filters Cell Data to Point Data and Warp By Scalar (element_density) give
the same surface.
"""

import argparse
import os
import pathlib
import sys

from opengl import probe_rendering

from fpk_rocking.results.pictures import OVERTURNED, SURFACE

_HEIGHT = 1.6


def main(arguments=None, probe=probe_rendering) -> int:
    """Show a series; exit status 0, or 1 with one message on standard error where that is not possible."""
    parser = argparse.ArgumentParser(description="Show a series of joint densities.")
    parser.add_argument("folder", type=pathlib.Path, help="folder with the .pvd file")
    parser.add_argument("--series", default="jpdf", help="name of the .pvd file (default: %(default)s)")
    parser.add_argument("--cycle", type=int, help="cycle to begin with (default: the first after the start)")
    parser.add_argument("--screenshot", type=pathlib.Path, help="write a picture to this file instead of a window")
    options = parser.parse_args(arguments)

    listing = options.folder / f"{options.series}.pvd"
    problem = _problem(listing, options.screenshot, probe)
    if problem:
        sys.stderr.write(f"view: {problem}\n")
        return 1
    frames = _frames(listing)
    cycles = [int(frame.field_data["cycle"][0]) for frame in frames]
    first = options.cycle if options.cycle is not None else next((cycle for cycle in cycles if cycle > 0), cycles[0])
    if first not in cycles:
        sys.stderr.write(f"view: --cycle: got {first}, accepted: {', '.join(map(str, cycles))}\n")
        return 1
    _show(frames, cycles.index(first), options.screenshot)
    return 0


def _problem(listing, screenshot, probe) -> str:
    """Say why nothing can be shown and what to do, or return an empty string."""
    if not listing.is_file():
        return f"there is no {listing}; write it with: python cases/fig06_jpdf_evolution.py --out {listing.parent}"
    elsewhere = f"copy the folder to a machine with a screen and open {listing.name} there in ParaView"
    rendering = probe()
    if not rendering.works:
        package = "install an OpenGL library (Debian, Ubuntu: apt install libgl1 libegl1)"
        return f"{rendering.reason}; {package}, or {elsewhere}"
    displays = ("DISPLAY", "WAYLAND_DISPLAY")
    if not screenshot and sys.platform.startswith("linux") and not any(os.environ.get(name) for name in displays):
        return f"no display (DISPLAY is not set); take a picture with --screenshot FILE, or {elsewhere}"
    return ""


def _frames(listing) -> list:
    """Meshes of pyvista, one a cycle, that a .pvd file lists."""
    import pyvista

    reader = pyvista.get_reader(listing)
    frames = []
    for time in reader.time_values:
        reader.set_active_time_value(time)
        frames.append(reader.read()[0])
    return frames


def _show(frames, first, screenshot):
    """Show frames from the one at place `first` on in a window, or write that one to a picture."""
    import pyvista
    from vtkmodules.vtkCommonCore import vtkLogger

    # Without a screen VTK warns of the window systems it tries before it finds one that renders off screen.
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_ERROR)
    plotter = pyvista.Plotter(off_screen=screenshot is not None, window_size=(1200, 900))
    plotter.set_background("white")

    def draw(place):
        _draw(plotter, frames[round(place)])

    draw(first)
    plotter.view_vector((0.55, -1.0, 0.75))
    if screenshot:
        plotter.show(auto_close=False)
        screenshot.parent.mkdir(parents=True, exist_ok=True)
        plotter.screenshot(screenshot)
        plotter.close()
        return
    if len(frames) > 1:
        place = {"pointa": (0.05, 0.88), "pointb": (0.5, 0.88), "style": "modern", "color": "black"}
        looks = {"title": "place in the series", "title_height": 0.022, "fmt": "%.0f", "interaction_event": "always"}
        plotter.add_slider_widget(draw, (0, len(frames) - 1), value=first, **place, **looks)
    plotter.show(title="fpk-rocking")


def _draw(plotter, frame):
    """Replace what is shown by one cycle; every part keeps its name, so that the new one takes the old one's place."""
    import pyvista

    values = {name: float(frame.field_data[name][0]) for name in frame.field_data}
    surface, peak = _surface(frame)
    for title in list(plotter.scalar_bars.keys()):
        plotter.remove_scalar_bar(title)
    bar = {"title": "density", "color": "black", "vertical": True, "fmt": "%.3g"}
    colours = {"clim": (0.0, peak or 1.0), "scalar_bar_args": bar, "show_scalar_bar": peak > 0.0}
    plotter.add_mesh(surface, scalars="element_density", cmap=SURFACE, name="surface", **colours)

    low, high = frame.bounds[2:4]
    for name, x in (("overturned_left", -values["cut_off"]), ("overturned_right", values["cut_off"])):
        height = max(_HEIGHT * values[name], 1e-3)
        corners = [(x, low, 0.0), (x, high, 0.0), (x, high, height), (x, low, height)]
        wall = pyvista.PolyData(corners, faces=[4, 0, 1, 2, 3])
        plotter.add_mesh(wall, color=OVERTURNED, opacity=0.5, lighting=False, name=name)
    _needle(plotter, frame)
    sides = f"overturned: left {values['overturned_left']:.4f}, right {values['overturned_right']:.4f}"
    text = f"{values['cycle']:.0f} cycles, tau = {values['tau']:.2f};  survival {values['survival']:.4f};  {sides}"
    plotter.add_text(text, name="caption", color="black", font_size=14)
    titles = {"xtitle": "angle", "ytitle": "velocity", "show_zaxis": False, "show_zlabels": False, "ztitle": " "}
    plotter.show_bounds(bounds=(*frame.bounds[:4], 0.0, _HEIGHT), color="black", location="outer", **titles)


def _surface(frame):
    """Return a surface through the means over the elements, each side of x = 0 its own, and its peak."""
    import pyvista

    middles = frame.cell_centers().points[:, 0]
    sides = [frame.extract_cells(chosen).clean().cell_data_to_point_data() for chosen in (middles < 0.0, middles > 0.0)]
    surface = pyvista.merge(sides, merge_points=False)
    peak = float(surface.point_data["element_density"].max())
    return (surface.warp_by_scalar("element_density", factor=_HEIGHT / peak) if peak > 0.0 else surface), peak


def _needle(plotter, frame):
    """Draw the needle of a point start of a frame, or remove it."""
    import pyvista

    vertices = frame.extract_cells(frame.celltypes == pyvista.CellType.VERTEX)
    plotter.remove_actor("needle")
    if vertices.n_cells:
        foot = vertices.points[0]
        plotter.add_mesh(pyvista.Line(foot, (foot[0], foot[1], _HEIGHT)), color="black", line_width=4, name="needle")


if __name__ == "__main__":
    sys.exit(main())
