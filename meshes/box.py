"""Graded grids of tetrahedra in a box between walls, as gmsh models with the boundaries named."""

from collections.abc import Iterator
from contextlib import contextmanager
from itertools import permutations
from typing import Any

import numpy as np

from incipient.arrays import Floats, Integers

from .model import complaints_as_errors, session
from .region import BoxGrid
from .tetrahedra import Tetrahedra


@contextmanager
def box_model(grid: BoxGrid, order: int) -> Iterator[Any]:
    """Yield the gmsh model of a grid in a box, with straight cells of an order. Not collective: one rank draws."""
    with session() as model:
        with complaints_as_errors():
            cut(grid).of_order(order).put()
        yield model


def cut(grid: BoxGrid) -> Tetrahedra:
    """The tetrahedra of a grid: six of each cell, which share its diagonal from the next corner of the whole box on.

    So none has all of its corners on walls. In such a one at a corner of the box the velocity of order two vanishes,
    and the pressure there is not determined.
    """
    counts = np.array([len(ends) for ends in grid.ends])
    places = [
        low + (high - low) * np.array([0.0, *ends])
        for (low, high), ends in zip(grid.extents, grid.ends, strict=True)
    ]
    points = np.stack(np.meshgrid(*places, indexing="ij"), axis=-1).reshape(-1, 3)
    strides = np.array([(counts[1] + 1) * (counts[2] + 1), counts[2] + 1, 1])
    first = np.stack(np.meshgrid(*map(np.arange, counts), indexing="ij"), axis=-1).reshape(-1, 3)
    inwards = np.where(first < counts / 2 * [1, not grid.half, 1], 1, -1)
    outermost = first + (inwards < 0)
    found = []
    for turns in permutations(range(3)):
        steps = [inwards * (np.arange(3) == axis) for axis in turns]
        corners = outermost + np.cumsum([np.zeros_like(first), *steps], axis=0)  # (4, cells, 3)
        found.append((corners @ strides).T)
    cells = np.concatenate(found)
    sides: dict[str, Integers] = {}
    for (axis, end), name in zip(
        [(a, e) for a in range(3) for e in (0, counts[a])], grid.sides, strict=True
    ):
        there = (cells // strides[axis]) % (counts[axis] + 1) == end
        of_side = there.sum(axis=1) == 3
        triangles = cells[of_side][there[of_side]].reshape(-1, 3)
        sides[name] = np.concatenate([sides[name], triangles]) if name in sides else triangles
    return Tetrahedra(points, _turned_outwards(points, cells), sides)


def _turned_outwards(points: Floats, cells: Integers) -> Integers:
    """The cells with two corners exchanged where their volume would be negative."""
    a, b, c, d = points[cells].transpose(1, 0, 2)
    inside_out = np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a) < 0.0
    return np.where(inside_out[:, None], cells[:, [0, 2, 1, 3]], cells)
