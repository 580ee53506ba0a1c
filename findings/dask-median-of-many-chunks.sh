#!/usr/bin/env bash
# Dask: the median of an array in many chunks is too high, and more of them make it worse.
#
# One would guess: the percentiles that dask.array.percentile merges from those of chunks are approximate, so that they
# scatter about the right ones: 10,000 lognormal capacities in 100 chunks of 100 have their median to a per cent or so.
# What happens: they are biased. The median is 14 % too high, the first percentile 40 %; with chunks of 10 the median is
# 29 % too high. Chunks with unlike values are worse: of two groups of equal size about 1 and 3 the median is 2.6.
# Seen with Dask 2026.8.0.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check dask==2026.8.0 numpy==2.4.6
cd "$folder"
"$folder/venv/bin/python" - <<'PYTHON'
import dask
import dask.array as da
import numpy as np

dask.config.set(scheduler="synchronous")
rng = np.random.default_rng(0)
capacities = rng.lognormal(0.0, 0.4, (5, 10_000))


def merged(values, chunk, percent):
    return float(np.ravel(da.percentile(da.from_array(values, chunks=chunk), [percent]).compute())[0])


def ratios(chunk, percent):
    """Percentiles of the samples over the right ones."""
    return np.array([merged(values, chunk, percent) / np.percentile(values, percent) for values in capacities])


print("dask", dask.__version__)
for chunk, low, high in ((10, 1.25, 1.35), (100, 1.10, 1.18), (1000, 1.01, 1.06)):
    middle, first = ratios(chunk, 50.0), ratios(chunk, 1.0)
    error = middle.std(ddof=1) / np.sqrt(middle.size)
    print(f"chunks of {chunk}: median {middle.mean():.3f} ± {error:.3f} times, first percentile {first.mean():.3f} times")
    assert low < middle.mean() < high
    assert middle.mean() - 1.0 > 5.0 * error
groups = np.concatenate([rng.normal(1.0, 0.1, 50_000), rng.normal(3.0, 0.1, 50_000)])
median = merged(groups, 10_000, 50.0)
print(f"two groups: {median:.2f}, right {np.median(groups):.2f}")
assert median > 2.5
PYTHON
