"""Values of fields at points, and extrema along lines, on any number of ranks."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from .locator import Locator, evaluate

if TYPE_CHECKING:
    from ..fluid import Fluid
    from ..scene import Domain


def sample(function: Any, points: np.ndarray) -> np.ndarray:
    """Values (n, components) of a dolfinx function at points (n, gdim or 3), the same on every rank. Collective.

    Points outside the mesh give NaN.
    """
    mesh = function.function_space.mesh
    places = Locator(mesh).inside(points)
    values = np.full((len(points), function.function_space.dofmap.index_map_bs), np.nan)
    values[places.found] = evaluate(function, places.at(places.found))
    for other in mesh.comm.allgather(values):
        missing = np.isnan(values).any(axis=1)
        values[missing] = other[missing]
    return values


@dataclass(frozen=True)
class Extremum:
    """An extreme value and the coordinate along the line at which it is taken."""

    value: float
    position: float


def extremum(
    function: Any,
    component: int,
    line: Callable[[np.ndarray], np.ndarray],
    between: Sequence[float],
    sign: int,
) -> Extremum:
    """Largest (sign = 1) or smallest (sign = -1) value of a component along a line. Collective.

    `line` maps parameters (n,) to points (n, gdim); the best of 400 samples is refined three times.
    """
    low, high = between
    for _ in range(4):
        s = np.linspace(low, high, 401)
        values = sample(function, line(s))[:, component]
        best = int(np.nanargmax(sign * values))
        low, high = s[max(best - 1, 0)], s[min(best + 1, 400)]
    return Extremum(float(values[best]), float(s[best]))


def cells_between(mesh: Any, start: Sequence[float], end: Sequence[float]) -> int:
    """Number of cells that a straight line crosses. Collective."""
    s = np.linspace(0.0, 1.0, 201)[:, None]
    points = (1 - s) * np.asarray(start) + s * np.asarray(end)
    places = Locator(mesh).inside(points)
    return int(mesh.comm.allreduce(len(np.unique(places.cells[places.found]))))


def centrelines(domain: Domain, fluid: Fluid) -> dict[str, Extremum]:
    """Extrema of the velocity on the centrelines of a box. Collective.

    Along the upright one it is the first component, along the level one in the lid's direction the upward one.
    """
    up = domain.up
    centre = np.array([*domain.entrance[:-1], domain.bottom + 0.5 * domain.height])
    centre[0] += 0.5 * domain.length

    def along(axis: int) -> Callable[[np.ndarray], np.ndarray]:
        direction = np.eye(domain.gdim)[axis]
        return lambda s: centre + (s - centre[axis])[:, None] * direction

    upright, level = (domain.bottom, domain.ceiling), (domain.left, domain.right)
    upward = f"v{up + 1}"
    return {
        "minimum of v1": extremum(fluid.velocity, 0, along(up), upright, sign=-1),
        f"maximum of {upward}": extremum(fluid.velocity, up, along(0), level, sign=1),
        f"minimum of {upward}": extremum(fluid.velocity, up, along(0), level, sign=-1),
    }
