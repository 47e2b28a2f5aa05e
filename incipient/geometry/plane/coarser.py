"""Coarser copies of traced outlines: what a tracing of less resolution would have been."""

from __future__ import annotations

import numpy as np

from incipient.arrays import Floats, planar_cross, unit

SHARP = np.radians(35.0)  # turn of an outline at a corner that is its shape, not its resolution
EVERY = ((2, 0), (2, 1), (3, 0))  # of how many points one is kept, and the first one, copy by copy


def coarser_outline(points: Floats, copy: int, closed: bool) -> Floats:
    """Every second or third of points (n, 2) of an outline, sharp corners and ends kept; `copy` is 0, 1 or 2."""
    every, first = EVERY[copy % len(EVERY)]
    kept = np.arange(len(points)) % every == first
    before, after = points - np.roll(points, 1, axis=0), np.roll(points, -1, axis=0) - points
    along, onwards = unit(before), unit(after)
    kept |= np.abs(np.arctan2(planar_cross(along, onwards), (along * onwards).sum(axis=1))) > SHARP
    if not closed:
        kept[[0, -1]] = True
    return points[kept]
