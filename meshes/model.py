"""Regions and graded grids meshed, with their boundaries named."""

from itertools import permutations

import numpy as np

from .plane import meshed_region
from .regions import Grid, Region, Sizes, SolidRegion
from .session import session
from .simplices import Simplices, measures
from .space import meshed_solid_region

NO_SIZES = Sizes(1.0)  # of grids


def meshed(
    shape: Region | SolidRegion | Grid, sizes: Sizes = NO_SIZES, order: int = 1
) -> Simplices:
    """The mesh of a shape in triangles or tetrahedra of an order, in the scene.

    Raises MeshError if gmsh finds no mesh, surfaces cross, layers do not fit, or curved cells fold over.
    """
    if isinstance(shape, Grid):
        return grid_cells(shape).of_order(order)
    with session():
        if isinstance(shape, SolidRegion):
            return meshed_solid_region(shape, sizes, order)
        return meshed_region(shape, sizes, order)


def grid_cells(grid: Grid) -> Simplices:
    """The cells of a grid: a rectangle's diagonals alternate, a box's six tetrahedra share one.

    Unless all are parallel, that of a box leads from its next corner inwards: a tetrahedron with all corners on walls
    would leave the pressure undetermined.
    """
    counts = np.array([len(ends) for ends in grid.ends])
    gdim = len(counts)
    axes = [
        low + (high - low) * np.array([0.0, *ends])
        for (low, high), ends in zip(grid.extents, grid.ends, strict=True)
    ]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, gdim)
    first = np.stack(np.meshgrid(*map(np.arange, counts), indexing="ij"), axis=-1)
    first = first.reshape(-1, gdim)
    if gdim == 3 and grid.parallel:
        inwards = np.ones_like(first)
    elif gdim == 3:
        inwards = np.where(first < counts / 2 * [1, not grid.half, 1], 1, -1)
    else:
        inwards = np.column_stack([np.ones(len(first), int), 2 * (first.sum(axis=1) % 2) - 1])
    strides = np.cumprod([1, *(counts[:0:-1] + 1)])[::-1]
    corners = []
    for axis_order in permutations(range(gdim)):
        steps = [inwards * (np.arange(gdim) == axis) for axis in axis_order]
        corners.append(first + (inwards < 0) + np.cumsum([np.zeros_like(first), *steps], axis=0))
    cells = np.concatenate([(corner @ strides).T for corner in corners])
    inside_out = measures(points, cells) < 0.0
    cells[inside_out] = cells[inside_out][:, [0, 2, 1, *range(3, gdim + 1)]]
    sides: dict[str, list[np.ndarray]] = {}
    for number, name in enumerate(grid.sides):
        axis, end = number // 2, (number % 2) * counts[number // 2]
        there = (cells // strides[axis]) % (counts[axis] + 1) == end
        facets = cells[there.sum(axis=1) == gdim]
        facets = facets[there[there.sum(axis=1) == gdim]].reshape(-1, gdim)
        sides.setdefault(name, []).append(facets)
    named = {name: np.concatenate(parts) for name, parts in sides.items()}
    return Simplices(points, cells, named)
