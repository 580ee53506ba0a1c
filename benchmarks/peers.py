"""Other packages on the problems that they can state; writes docs/peers.md.

make peers                 # about 10 minutes on 2 cores, half of it compilation
"""

import importlib.metadata

import jax
import peers_diffrax
import peers_flights
import peers_pde
import peers_published
from report import ROOT, table, write_section

PAGE = ROOT / "docs" / "peers.md"
HEAD = """# Peers

Written by `make peers`, on 2 cores: other packages on problems that both they and a scene can state, each with the
method and settings that were fastest for it. Times are comparable within a table only: there the packages took turns in
one run, and compilation is left out.
"""
SECTIONS = {
    "py-pde: an oscillator without impact": peers_pde,
    "diffrax: white noise": peers_diffrax,
    "diffrax: band noise": peers_flights,
}
PACKAGES = "py-pde", "diffrax", "jax", "numba", "numpy", "scipy"


def summary(kramers, paths, flights):
    """Return the table of peers from the ratios of the sections."""
    easy, hard = kramers.values()
    white = [f"{paths[n, True][0]:.1f} with {n} steps a cycle ({paths[n, True][1]})" for n in peers_diffrax.STEPS]
    head = ["peer", "can it state the main scene?", "compared on", "its time over ours"]
    rows = [
        [
            "py-pde", "no: its operators know no jump at x = 0 inside a grid, and no start at a point",
            "an oscillator without impact",
            f"D = 0.05: {easy}. D = 0.00628: {hard}",
        ],
        [
            "diffrax, white noise", "paths only, the impacts by a map written by hand", "the main scene, survival",
            f"a path, and the error of S(10) in brackets: {', '.join(white)}",
        ],
        [
            "diffrax, band noise", "paths only, a loop over flights written by hand", "the main scene, path by path",
            f"{flights:,.0f} at a tolerance of {peers_flights.TOLS[-1]:g}",
        ],
        [
            "path integration", "no: its walls reflect, none is passed through",
            "nothing: a scene cannot state what is published", "-",
        ],
    ]  # fmt: skip
    return table(head, rows)


def main():
    """Measure all, and write the page."""
    jax.config.update("jax_platforms", "cpu")
    bodies, ratios = {}, []
    for title, module in SECTIONS.items():
        print(f"== {title}", flush=True)
        bodies[title], ratio = module.section()
        ratios.append(ratio)
    versions = ", ".join(f"{name} {importlib.metadata.version(name)}" for name in PACKAGES)
    write_section("Table", f"{summary(*ratios)}\n\nVersions: {versions}.", PAGE, HEAD)
    for title, body in bodies.items():
        write_section(title, body, PAGE)
    write_section("Inelastic walls: published figures", peers_published.section(), PAGE)


if __name__ == "__main__":
    main()
