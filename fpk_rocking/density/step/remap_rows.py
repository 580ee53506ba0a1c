"""Remaps of `remap.py` applied to the values on a row's lines, what passes its ends, and the adjoints of both."""

from fpk_rocking.base.arrays import scratch
from fpk_rocking.base.jit import kernel
from fpk_rocking.density.step.targets import FASTMATH, MOST_MODES

_line_sums = scratch(1, MOST_MODES)


@kernel(fastmath=FASTMATH)
def remap_row(r, values, source, target, remap, moved, basis):
    """Write to `moved` (cells, lines, modes) the target cells of row r by `values` of its source cells."""
    origin, first, count, start, blocks = remap.origin, remap.first, remap.count, remap.start, remap.blocks
    modes, shared = len(basis), first.shape[1] == 1
    base, sums = origin[min(r, len(origin) - 1)], _line_sums()
    for c in range(target[0], target[1]):
        for q in range(modes):
            line = 0 if shared else q
            begin = first[base + c, line]
            low, high = max(begin, source[0]), min(begin + count[base + c, line], source[1])
            block = start[base + c, line] + low - begin
            for i in range(modes):
                sums[0, i] = 0.0
            for s in range(low, high):
                for k in range(modes):
                    value = values[s, q, k]
                    for i in range(modes):
                        sums[0, i] += blocks[block, k, i] * value
                block += 1
            for i in range(modes):
                moved[c, q, i] = sums[0, i]


@kernel(fastmath=FASTMATH)
def adjoint_remap_row(r, values, source, target, remap, moved, basis):
    """Add to `moved` values (cells, lines, modes) of source cells by `values` of target cells of row r."""
    origin, first, count, start, blocks = remap.origin, remap.first, remap.count, remap.start, remap.blocks
    modes, shared = len(basis), first.shape[1] == 1
    base = origin[min(r, len(origin) - 1)]
    for c in range(target[0], target[1]):
        for q in range(modes):
            line = 0 if shared else q
            begin = first[base + c, line]
            low, high = max(begin, source[0]), min(begin + count[base + c, line], source[1])
            block = start[base + c, line] + low - begin
            for s in range(low, high):
                for k in range(modes):
                    total = 0.0
                    for i in range(modes):
                        total += blocks[block, k, i] * values[c, q, i]
                    moved[s, q, k] += total
                block += 1


@kernel(fastmath=FASTMATH)
def mass_past_end(r, end, values, source, remap, masses):
    """Write `masses` (lines,) of row r that pass an end, per size of their cells across; return whether any does."""
    place = remap.end_places[min(r, len(remap.end_places) - 1), end]
    if place < 0:
        return False
    ends = remap.end_masses[place]
    for q in range(len(masses)):
        line = ends[0 if len(ends) == 1 else q]
        masses[q] = 0.0
        for c in range(source[0], source[1]):
            for k in range(len(masses)):
                masses[q] += line[c, k] * values[c, q, k]
    return True


@kernel(fastmath=FASTMATH)
def adjoint_mass_past_end(r, end, exit_values, source, remap, moved):
    """Add to `moved` (cells, lines, modes) what passes an end of row r times `exit_values` (lines,)."""
    place = remap.end_places[min(r, len(remap.end_places) - 1), end]
    if place < 0:
        return
    ends = remap.end_masses[place]
    for q in range(len(exit_values)):
        line = ends[0 if len(ends) == 1 else q]
        for c in range(source[0], source[1]):
            for k in range(len(exit_values)):
                moved[c, q, k] += exit_values[q] * line[c, k]


@kernel(fastmath=FASTMATH)
def clamp_to_end(end, masses, target, edges, sizes, moved):
    """Add `masses` (lines,) that passed an end of a row to its last cell in `moved`, at that end (boundary clamp)."""
    cell = target[0] if end == 0 else target[1] - 1
    for q in range(len(masses)):
        for i in range(len(masses)):
            moved[cell, q, i] += masses[q] / sizes[cell] * edges[end, i]


@kernel(fastmath=FASTMATH)
def adjoint_clamp_to_end(end, values, target, edges, sizes, end_values):
    """Write to `end_values` (lines,) those of a function at an end of a row, from `values` of its cells."""
    cell = target[0] if end == 0 else target[1] - 1
    for q in range(len(end_values)):
        end_values[q] = 0.0
        for i in range(len(end_values)):
            end_values[q] += values[cell, q, i] * edges[end, i] / sizes[cell]
