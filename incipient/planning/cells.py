"""The sides of a scene's domain, and the cells away from everything."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from ..arrays import Point
from ..geometry.plane.curves import Curve
from ..scene import Scene

FAR_CELL = {2: 0.10, 3: 0.15, 4: 0.20}  # of the domain's height
FAR_CELL_IN_SPACE = {2: 0.25, 3: 0.45, 4: 0.5}  # likewise


# Names of the lines that close the space below a grain in turbulent flow, upstream and downstream of its contacts.
CLOSED = ("closed upstream", "closed downstream")
GRID_CELLS = {2: 48, 3: 32, 4: 24}  # along the shorter side of an empty box
GRID_CELLS_IN_SPACE = {2: 16, 3: 9, 4: 6}  # likewise (docs/space.md)
FEWEST = {2: 4, 3: 2}  # along a side of such a grid, by dimension, whatever the cells' size


def side_names(scene: Scene) -> tuple[str, str, str, str]:
    """Names of the bottom, right, top and left boundary; right and left are those at the ends of the stream."""
    bottom = "bed" if scene.bed is not None else "bottom"
    if scene.domain.kind == "channel":
        return bottom, "outflow", "top", "inflow"
    return (bottom, "right", "top", "left") if scene.gdim == 2 else (bottom, "downstream", "top", "upstream")


def sides_across(scene: Scene) -> tuple[str, ...]:
    """Names of the sides that a domain in space has at its least and largest y; of half a domain only the latter."""
    if scene.gdim == 2:
        return ()
    return ("left",) if scene.symmetric else ("right", "left")


def largest_cell(scene: Scene) -> float:
    """Size of the cells away from everything for mesh_size = 1 [length]."""
    domain, order = scene.domain, scene.order
    if not scene.is_empty_box:
        return FAR_CELL[order] * domain.height
    # Boundary layers thin as Re^-1/2, the grading makes up for half of that.
    crowd = max(1.0, (scene.fluid.reynolds / 1000.0) ** 0.25)
    cells = GRID_CELLS if scene.gdim == 2 else GRID_CELLS_IN_SPACE
    return min(domain.extents) / (cells[order] * crowd)


def largest_cell_in_space(scene: Scene, order: int) -> float:
    """Size of the cells away from everything in space for mesh_size = 1 and an order of the velocity [length]."""
    domain = scene.domain
    if scene.is_empty_box:
        return largest_cell(scene)
    return min(FAR_CELL_IN_SPACE[order] * domain.height, 0.5 * min(domain.extents))


def coarsest_grid(scene: Scene) -> float:
    """The largest numerics.mesh_size by which an empty box's cells become larger; no bound in other scenes."""
    if not scene.is_empty_box:
        return math.inf
    return min(scene.domain.extents) / (FEWEST[scene.gdim] * largest_cell(scene))


def layer_ends(layers: int, grading: float, half: bool) -> tuple[float, ...]:
    """Where layers across the width end, as parts of it: from sides on they thicken evenly.

    grading: thickness next to sides over that in the middle; 1: all are alike
    half:    the first layer lies at the plane of symmetry
    """
    middles = (np.arange(layers) + 0.5) / layers
    away = 1.0 - middles if half else 2.0 * np.minimum(middles, 1.0 - middles)
    ends = np.cumsum(grading + (1.0 - grading) * away)
    return (*map(float, ends[:-1] / ends[-1]), 1.0)


def corners(curves: Iterable[Curve], following: Iterable[Curve]) -> tuple[Point, ...]:
    """Where each curve meets the one that follows it at an angle of more than ten degrees."""
    cosine = np.cos(np.radians(10.0))
    return tuple(
        after.start
        for before, after in zip(curves, following, strict=False)
        if before.tangent([1.0])[0] @ after.tangent([0.0])[0] < cosine
    )
