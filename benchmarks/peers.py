"""Other packages on the problems that they can state; writes its section of docs/validation.md.

make peers                 # about 10 minutes on 2 cores, half of it compilation
"""

import importlib.metadata

import jax
import peers_diffrax
import peers_flights
import peers_pde
import peers_published
from report import VALIDATION, table, write_section

RESULT = """**Result.** None of the packages compared solves for the density of a rocking block. py-pde cannot state the
impact. Without impact it is faster than the density solver at strong noise and a large error, and several to tens of
times slower at weak noise. diffrax samples paths if their impacts are written by hand: under white noise it is about as
fast as the engine here, under band noise hundreds to thousands of times slower."""
METHOD = """Each package solves problems that both it and a scene of this package can state, with the method and
settings that were fastest for it, on 2 cores. Times are comparable within a table only: there the packages took turns
in one run, and compilation is left out."""
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
    head = ["peer", "can it state the main scene?", "compared on", "its time over that of this package"]
    rows = [
        [
            "py-pde",
            "no: its operators cannot jump at a line inside the grid, and a grid cannot hold a start at a point",
            "an oscillator without impact",
            f"D = 0.05: {easy}. D = 0.00628: {hard}",
        ],
        [
            "diffrax, white noise", "its paths, with impacts by a map written by hand", "the main scene, survival",
            f"time of a path (error of S(10) in brackets): {', '.join(white)}",
        ],
        [
            "diffrax, band noise", "its paths, with a loop over flights written by hand",
            "the main scene, path by path",
            f"time of a path: {flights:,.0f} at a tolerance of {peers_flights.TOLS[-1]:g}",
        ],
        [
            "path integration", "no: its walls reflect, while a block passes through x = 0",
            "nothing: a scene cannot state what is published", "-",
        ],
    ]  # fmt: skip
    return table(head, rows)


def main():
    """Measure all, and write the sections."""
    jax.config.update("jax_platforms", "cpu")
    bodies, ratios = {}, []
    for title, module in SECTIONS.items():
        print(f"== {title}", flush=True)
        bodies[title], ratio = module.section()
        ratios.append(ratio)
    versions = ", ".join(f"{name} {importlib.metadata.version(name)}" for name in PACKAGES)
    body = f"{RESULT}\n\n{METHOD}\n\n{summary(*ratios)}\n\nVersions: {versions}."
    write_section("Other packages", body, VALIDATION)
    for title, body in bodies.items():
        write_section(title, body, None)
    write_section("Inelastic walls: published figures", peers_published.section(), None)


if __name__ == "__main__":
    main()
