"""Layers of thin cells along walls: columns of points, and the cells between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from incipient.arrays import Floats, Integers
from incipient.geometry.plane.curves import increasing_roots

from .sizes import WallLayers

STEEPER = (
    1.1  # than wanted: ratio of the thicknesses of neighbouring layers where there is much room
)
FEWER = 0.3  # of a layer, for which no further one is made
MOST_TRIALS = 40  # at layers whose cells are not inside out
NO_ROOM = "there is no room for layers of cells along the walls: use another numerics.mesh_size"


@dataclass(frozen=True, eq=False)
class Columns:
    """Columns of points on the points of walls.

    points (n, gdim): the mesh's own, and those above walls
    rows (columns, layers + 1): numbers of a column's points, the last ones alike where it has fewer layers
    share (columns, layers + 1): one at the wall, zero where the layers end
    """

    points: Floats
    rows: Integers
    share: Floats

    @classmethod
    def standing(
        cls,
        points: Floats,
        feet: Integers,
        direction: Floats,
        thickness: Floats,
        first: Floats,
        layers: WallLayers,
    ) -> Columns:
        """Columns on points of walls in directions (columns, gdim), of given thickness and first layers."""
        heights = layer_heights(thickness, first, layers)
        new = np.diff(heights, axis=1, prepend=0.0) > 0.0
        numbers = np.where(new, len(points) + np.cumsum(new.ravel()).reshape(new.shape) - 1, -1)
        rows = np.maximum.accumulate(numbers, axis=1)
        rows = np.where(rows < 0, feet[:, None], rows)
        above = points[feet, None] + heights[:, :, None] * direction[:, None]
        share = 1.0 - heights / np.where(thickness > 0.0, thickness, np.inf)[:, None]
        return cls(np.concatenate([points, above[new]]), rows, share)

    def by_point(self, count: int) -> tuple[Integers, Floats]:
        """The wall's point below each of a mesh's points (count,), -1: none, and the share there."""
        foot, share = np.full(count, -1), np.zeros(count)
        foot[self.rows] = self.rows[:, :1]
        share[self.rows] = self.share
        return foot, share


def stacked(rows: Integers) -> Integers:
    """The simplices between columns (k, gdim, layers + 1) on each facet of a wall.

    They have one sense where facets have: edges run with the fluid on the left, triangles turn left seen from it.
    """
    gdim, low, high = rows.shape[1], rows[:, :, :-1], rows[:, :, 1:]
    parts = []
    for k in range(gdim):
        corners = np.concatenate([low[:, : k + 1], high[:, k:]], axis=1)
        if (gdim - k) % 2 == 0:
            corners[:, [-1, -2]] = corners[:, [-2, -1]]
        parts.append(corners.transpose(0, 2, 1).reshape(-1, gdim + 1))
    cells = np.concatenate(parts)
    ordered = np.sort(cells, axis=1)
    return cells[(ordered[:, 1:] > ordered[:, :-1]).all(axis=1)]


def stacked_by_diagonals(points: Floats, rows: Integers) -> Integers:
    """The triangles between columns (k, 2, layers + 1), cut along the shorter diagonals."""
    pairs = np.stack([rows[:, :, :-1], rows[:, :, 1:]], axis=-1).transpose(0, 2, 1, 3)
    pairs = pairs.reshape(-1, 2, 2)
    (a, d), (b, c) = points[pairs].transpose(1, 2, 0, 3)
    other = ((a - c) ** 2).sum(axis=1) > ((b - d) ** 2).sum(axis=1)
    return np.concatenate([stacked(pairs[~other]), stacked(pairs[other, ::-1])[:, [0, 2, 1]]])


def evened(thickness: Floats, links: Integers, slack: Floats) -> Floats:
    """Thickness (n,) that differs by at most the slack (k,) of links (k, 2)."""
    a, b = links.T
    even = thickness.copy()
    while True:
        before = even.copy()
        np.minimum.at(even, a, before[b] + slack)
        np.minimum.at(even, b, before[a] + slack)
        if np.array_equal(even, before):
            return even


def layer_heights(thickness: Floats, first: Floats, layers: WallLayers) -> Floats:
    """Heights (n, number + 1) above a wall at which layers end, with the given first one.

    At least one, as many as fit; further ones coincide with the last.
    """
    rows = np.log(1.0 + (layers.growth - 1.0) * thickness / first) / np.log(layers.growth)
    counts = np.clip(np.ceil(rows - FEWER), 1, layers.number)
    powers = np.arange(layers.number)
    there = powers < counts[:, None]
    steepest = np.full(len(first), 2.0 * STEEPER * layers.growth)
    ratio = increasing_roots(
        lambda r: first * (there * r[:, None] ** powers).sum(axis=1) - thickness,
        np.ones(len(first)),
        steepest,
    )[:, None]
    ends = np.cumsum(there * ratio**powers, axis=1)
    ends = np.where(powers < counts[:, None] - 1.0, ends / ends[:, -1:], 1.0)
    return np.asarray(thickness[:, None] * np.column_stack([np.zeros(len(first)), ends]))
