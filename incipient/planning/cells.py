"""The sides of a scene's domain, and the cells away from everything."""

from __future__ import annotations

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
    if not is_grid(scene):
        return FAR_CELL[order] * domain.height
    # Boundary layers thin as Re^-1/2, the grading makes up for half of that.
    crowd = max(1.0, (scene.fluid.reynolds / 1000.0) ** 0.25)
    return min(domain.length, domain.height) / (GRID_CELLS[order] * crowd)


def largest_cell_in_space(scene: Scene, order: int) -> float:
    """Size of the cells away from everything in space for mesh_size = 1 and an order of the velocity [length]."""
    domain = scene.domain
    return min(FAR_CELL_IN_SPACE[order] * domain.height, 0.5 * min(domain.extents))


def is_grid(scene: Scene) -> bool:
    """Whether the scene is an empty box in the plane, which gets a grid."""
    return scene.gdim == 2 and scene.domain.kind == "box" and scene.body is None and scene.bed is None


def corners(curves: Iterable[Curve], following: Iterable[Curve]) -> tuple[Point, ...]:
    """Where each curve meets the one that follows it at an angle of more than ten degrees."""
    cosine = np.cos(np.radians(10.0))
    return tuple(
        after.start
        for before, after in zip(curves, following, strict=False)
        if before.tangent([1.0])[0] @ after.tangent([0.0])[0] < cosine
    )
