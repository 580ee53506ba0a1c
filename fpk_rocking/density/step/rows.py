"""Rows of cells along the angle or the velocity, and the ranges of each that hold something."""

import numpy as np


def angle_rows(cells, middle):
    """Rows along the angle (2 * velocity cells, angle cells), those with x < 0 first, of marked cells."""
    rows = np.concatenate([cells.T, cells.T])
    rows[: cells.shape[1], middle:] = False
    rows[cells.shape[1] :, :middle] = False
    return rows


def by_velocity(rows):
    """Join the two rows of each interval of the velocity: (velocity cells, angle cells)."""
    left, right = np.split(rows, 2)
    return left | right


def hulls(rows):
    """First marked cell of each row and the one after the last, (rows, 2); 0, 0 where there is none."""
    ends = np.stack([rows.argmax(axis=1), rows.shape[1] - rows[:, ::-1].argmax(axis=1)], axis=1)
    return np.where(rows.any(axis=1)[:, None], ends, 0)


def covered(ranges, cells):
    """Mark the cells of ranges: (rows, cells)."""
    places = np.arange(cells)
    return (places >= ranges[:, :1]) & (places < ranges[:, 1:])


def union(first, second):
    """Hull of two ranges in each row."""
    empty = [(part[:, 1] == part[:, 0])[:, None] for part in (first, second)]
    both = np.stack([np.minimum(first[:, 0], second[:, 0]), np.maximum(first[:, 1], second[:, 1])], axis=1)
    return np.where(empty[0], second, np.where(empty[1], first, both))


def order(ranges):
    """Rows with something in them, dealt out so that equal parts of the list hold like rows."""
    rows = np.flatnonzero(ranges[:, 1] > ranges[:, 0])
    return np.concatenate([rows[::2], rows[1::2]])
