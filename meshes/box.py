"""Graded grids of tetrahedra in a box between walls, as gmsh models with the boundaries named."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import permutations
from typing import Any

import numpy as np

from incipient.arrays import Floats, Integers
from incipient.interrupt import handlers_kept

from .model import complaints_as_errors, session
from .region import BoxGrid

with handlers_kept():  # at its import gmsh takes interrupts for itself
    import gmsh

TRIANGLE, TETRAHEDRON = 2, 4  # gmsh's numbers of kinds of cells


@dataclass(frozen=True, eq=False)
class Cut:
    """A grid cut into cells: points (n, 3), tetrahedra (m, 4) of them, triangles (k, 3) by name of the side."""

    points: Floats
    cells: Integers
    sides: dict[str, Integers]


@contextmanager
def box_model(grid: BoxGrid, order: int) -> Iterator[Any]:
    """Yield the gmsh model of a grid in a box, with straight cells of an order. Not collective: one rank draws."""
    with session() as model:
        with complaints_as_errors():
            _put(cut(grid))
            model.mesh.setOrder(order)
        yield model


def cut(grid: BoxGrid) -> Cut:
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
    for (axis, end), name in zip([(a, e) for a in range(3) for e in (0, counts[a])], grid.sides, strict=True):
        there = (cells // strides[axis]) % (counts[axis] + 1) == end
        of_side = there.sum(axis=1) == 3
        triangles = cells[of_side][there[of_side]].reshape(-1, 3)
        sides[name] = np.concatenate([sides[name], triangles]) if name in sides else triangles
    return Cut(points, _turned_outwards(points, cells), sides)


def _turned_outwards(points: Floats, cells: Integers) -> Integers:
    """The cells with two corners exchanged where their volume would be negative."""
    a, b, c, d = points[cells].transpose(1, 0, 2)
    inside_out = np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a) < 0.0
    return np.where(inside_out[:, None], cells[:, [0, 2, 1, 3]], cells)


def _put(made: Cut) -> None:
    """Make a model of cells, with its parts named."""
    model, numbers = gmsh.model, np.arange(1, len(made.points) + 1)
    tags = {name: model.addDiscreteEntity(2) for name in made.sides}
    volume = model.addDiscreteEntity(3, -1, list(tags.values()))
    model.mesh.addNodes(3, volume, numbers, made.points.ravel())
    model.mesh.addElementsByType(volume, TETRAHEDRON, [], (made.cells + 1).ravel())
    for name, triangles in made.sides.items():
        model.mesh.addElementsByType(tags[name], TRIANGLE, [], (triangles + 1).ravel())
    model.mesh.reclassifyNodes()
    model.addPhysicalGroup(3, [volume], 1)
    model.setPhysicalName(3, 1, "fluid")
    for tag, (name, entity) in enumerate(tags.items(), start=1):
        model.addPhysicalGroup(2, [entity], tag)
        model.setPhysicalName(2, tag, name)
