"""Evenly spaced streamlines on a regular grid, after Jobard and Lefer (1997).

A streamline is traced until it comes too near to another one or to itself; the next starts beside those
already there, at the wanted distance. Inside this module lengths are counted in spacings of the grid.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import hypot

import numpy as np
from matplotlib.tri import LinearTriInterpolator

from ...arrays import quarter_turned, unit
from .mesh import QuadraticMesh, triangles_of

_CELLS_ACROSS = 400
_NEAREST = 0.45  # of the separation: where a streamline ends beside another, or beside itself
_SHORTEST = 2.5  # separations: shorter pieces are not shown
_SLOWEST = 1e-4  # of the greatest speed: where a streamline ends
_STEP = 0.8
_MOST_STEPS = 6 * _CELLS_ACROSS

Place = tuple[float, float]
Visited = dict[tuple[int, int], int]  # at which step a line first came to a patch of the plane
Direction = Callable[[float, float], Place | None]


@dataclass(frozen=True)
class Sampled:
    """Velocity (rows, columns, 2) on a regular grid, zero outside the fluid."""

    origin: np.ndarray
    spacing: float
    velocity: np.ndarray


def sample(
    mesh: QuadraticMesh, velocity: np.ndarray, view: tuple[float, float, float, float]
) -> Sampled:
    """Nodal velocity (nodes, 2) on a grid over a rectangle (left, right, bottom, top)."""
    x0, x1, y0, y1 = view
    spacing = max(x1 - x0, y1 - y0) / _CELLS_ACROSS
    # Half a spacing inside: on the boundary itself, round-off would decide whether a point is in the fluid.
    x, y = np.arange(x0 + spacing / 2, x1, spacing), np.arange(y0 + spacing / 2, y1, spacing)
    grids = np.meshgrid(x, y)
    seen = mesh.within(view)
    triangulation = triangles_of(seen.points, seen.quarters)
    finder = triangulation.get_trifinder()
    masked = [LinearTriInterpolator(triangulation, values, finder)(*grids) for values in velocity.T]
    components = [np.ma.filled(values, 0.0) for values in masked]
    return Sampled(np.array([x[0], y[0]]), spacing, np.stack(components, axis=-1))


def streamlines(sampled: Sampled, separation: float) -> list[np.ndarray]:
    """Lines (n, 2) about `separation` apart, directed with the flow; none where the fluid is at rest."""
    speed = np.linalg.norm(sampled.velocity, axis=-1)
    if not speed.max() > 0:
        return []
    apart = separation / sampled.spacing
    slowest = _SLOWEST * float(speed.max())
    room = _Room(speed > slowest, apart)
    direction = _interpolated(sampled.velocity, slowest)
    lines = []
    for seed in _seeds(room, speed, apart):
        line = _traced(seed, direction, room, _NEAREST * apart)
        room.occupy(line)
        if len(line) * _STEP > _SHORTEST * apart:
            lines.append(sampled.origin + sampled.spacing * line)
    return lines


class _Room:
    """Where on the grid there is room: to start a line at full distance from others, to continue it at less."""

    def __init__(self, moving: np.ndarray, apart: float):
        self.to_start, self.to_go_on = moving.copy(), np.ones_like(moving)
        self._wide, self._narrow = _disc(apart), _disc(_NEAREST * apart)
        self.newest = np.empty((0, 2))

    def occupy(self, line: np.ndarray) -> None:
        """Take the surroundings of a line (n, 2)."""
        self.newest = line
        nodes = np.unique(np.round(line).astype(int), axis=0)
        for free, disc in ((self.to_start, self._wide), (self.to_go_on, self._narrow)):
            column, row = (nodes[:, None] + disc).reshape(-1, 2).T
            inside = (column >= 0) & (row >= 0) & (column < free.shape[1]) & (row < free.shape[0])
            free[row[inside], column[inside]] = False


def _seeds(room: _Room, speed: np.ndarray, apart: float) -> Iterator[Place]:
    """Starts: where the flow is fastest, then beside the lines there are, then where room is left."""
    beside: deque[np.ndarray] = deque()
    order = np.argsort(-speed, axis=None)
    position = 0
    while True:
        while beside:
            x, y = beside.popleft()
            if _free(room.to_start, x, y):
                yield float(x), float(y)
                beside.extend(_neighbours(room.newest, apart))
        position += int(np.argmax(room.to_start.ravel()[order[position:]]))
        row, column = divmod(int(order[position]), speed.shape[1])
        if not room.to_start[row, column]:
            return
        yield float(column), float(row)
        room.to_start[row, column] = False  # also where no line could be drawn
        beside.extend(_neighbours(room.newest, apart))


def _neighbours(line: np.ndarray, apart: float) -> np.ndarray:
    """Places on both sides of a line, a little more than the separation away."""
    if len(line) < 2:
        return np.empty((0, 2))
    # A line that swings to and fro where streams meet goes nowhere: beside it is where it is.
    across = 1.05 * apart * quarter_turned(unit(np.gradient(line, axis=0)))
    every = max(1, int(apart / _STEP / 2))
    return np.concatenate([line[::every] + across[::every], line[::every] - across[::every]])


def _traced(seed: Place, direction: Direction, room: _Room, near: float) -> np.ndarray:
    """The line (n, 2) through a seed, downstream to its end and upstream to its beginning."""
    visited: Visited = {}
    downstream = _half(seed, direction, room, near, visited, 1)
    upstream = _half(seed, direction, room, near, visited, -1)
    return np.array([*reversed(upstream), seed, *downstream])


def _half(
    seed: Place, direction: Direction, room: _Room, near: float, visited: Visited, sense: int
) -> list[Place]:
    """Half a streamline from a seed by the midpoint rule, downstream or upstream, to where it must end."""
    x, y = seed
    line: list[Place] = []
    patch, lag = max(near, 1.0), 4 * max(near, 1.0) / _STEP
    step = sense * _STEP
    for count in range(_MOST_STEPS):
        first = visited.setdefault((int(x / patch), int(y / patch)), sense * count)
        if abs(sense * count - first) > lag or not _free(room.to_go_on, x, y):
            break
        if count:
            line.append((x, y))
        there = direction(x, y)
        there = there and direction(x + step / 2 * there[0], y + step / 2 * there[1])
        if there is None:
            break
        x, y = x + step * there[0], y + step * there[1]
    return line


def _interpolated(velocity: np.ndarray, slowest: float) -> Direction:
    """The direction of the flow at a place; None off the grid and where it is slower than `slowest`."""
    rows, columns = velocity.shape[:2]
    across, up = velocity[..., 0].ravel().tolist(), velocity[..., 1].ravel().tolist()

    def direction(x: float, y: float) -> Place | None:
        """A unit vector, bilinear between the nodes; plain numbers, as lines ask for one place at a time."""
        if not (0 <= x < columns - 1 and 0 <= y < rows - 1):
            return None
        i, j = int(x), int(y)
        s, t, k = x - i, y - j, j * columns + i
        a, b, c, d = (1 - s) * (1 - t), s * (1 - t), (1 - s) * t, s * t
        n = k + columns
        u = a * across[k] + b * across[k + 1] + c * across[n] + d * across[n + 1]
        v = a * up[k] + b * up[k + 1] + c * up[n] + d * up[n + 1]
        speed = hypot(u, v)
        return (u / speed, v / speed) if speed > slowest else None

    return direction


def _free(room: np.ndarray, x: float, y: float) -> bool:
    row, column = int(y + 0.5), int(x + 0.5)
    inside = x > -0.5 and y > -0.5 and row < room.shape[0] and column < room.shape[1]
    return inside and bool(room[row, column])


def _disc(radius: float) -> np.ndarray:
    """Grid offsets (n, 2) within a radius."""
    reach = np.arange(-int(radius), int(radius) + 1)
    offsets = np.stack(np.meshgrid(reach, reach), axis=-1).reshape(-1, 2)
    return offsets[np.linalg.norm(offsets, axis=1) <= radius]
