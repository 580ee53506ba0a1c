#!/usr/bin/env bash
# ARPACK and LAPACK: the second eigenvalue of a transfer operator, with a residual of 1e-15, is not there.
#
# One would guess: a matrix of transition probabilities has its second largest eigenvalue to rounding, if that of the
# eigenvector found leaves a residual of 1e-15; it says how fast a density forgets its start.
# What happens: for the doubling map in 1024 cells every density is uniform after ten steps, so all eigenvalues but 1 are
# 0. scipy.sparse.linalg.eigs (ARPACK) and numpy.linalg.eigvals (LAPACK) give others of .01 and .02, as the matrix is far
# from normal: one rounding error moves an eigenvalue of ten chained zeros by its tenth root. More cells make it worse.
# Seen with SciPy 1.17.1 and NumPy 2.4.6.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check numpy==2.4.6 scipy==1.17.1
cd "$folder"
"$folder/venv/bin/python" - <<'PYTHON'
import numpy as np
import scipy
from scipy.sparse.linalg import eigs

print("scipy", scipy.__version__, "numpy", np.__version__)


def doubling_map(steps):
    """Transition probabilities between 2^steps cells of x -> 2x mod 1: column from, row to."""
    size = 2**steps
    cells = np.arange(size)
    ones = np.full(2 * size, 0.5)
    places = np.concatenate([2 * cells % size, (2 * cells + 1) % size]), np.tile(cells, 2)
    return scipy.sparse.csc_array((ones, places), shape=(size, size))


def second(steps):
    """Second largest modulus by ARPACK, and the residual of its eigenvector."""
    matrix = doubling_map(steps)
    values, vectors = eigs(matrix, k=3, v0=np.random.default_rng(1).random(2**steps))
    place = np.argsort(-np.abs(values))[1]
    vector = vectors[:, place]
    return abs(values[place]), np.linalg.norm(matrix @ vector - values[place] * vector)


moduli = []
for steps in (6, 8, 10, 12):
    matrix, density = doubling_map(steps), np.eye(1, 2**steps)[0]
    for _ in range(steps):
        density = matrix @ density
    assert np.ptp(density) == 0.0  # uniform, exactly: no eigenvalue but 1 and 0
    modulus, residual = second(steps)
    moduli.append(modulus)
    print(f"{2**steps} cells: second eigenvalue {modulus:.2e}, residual {residual:.0e}")
    assert residual < 1e-13
dense = np.sort(np.abs(np.linalg.eigvals(doubling_map(10).toarray())))[-2]
print(f"LAPACK, 1024 cells: {dense:.2e}")
assert moduli[2] > 3e-3
assert moduli[3] > 1e-2
assert dense > 3e-3
PYTHON
