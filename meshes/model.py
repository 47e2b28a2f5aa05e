"""gmsh models of regions and grids, meshed and with their boundaries named."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from .grids import grid_cells
from .plane import meshed_region
from .regions import Grid, Region, SolidRegion
from .session import complaints_as_errors, gmsh, session
from .sizes import Sizes
from .space import meshed_solid_region

NO_SIZES = Sizes(1.0)  # of grids


@contextmanager
def meshed(
    shape: Region | SolidRegion | Grid, sizes: Sizes = NO_SIZES, order: int = 1
) -> Iterator[Any]:
    """Yield the gmsh model of a shape meshed with triangles or tetrahedra of an order. Not collective: one rank draws.

    Raises:
        MeshError: gmsh finds no mesh, surfaces cross, there is no room for layers, or curved cells fold over.
    """
    with session() as model:
        with complaints_as_errors():
            if isinstance(shape, Grid):
                mesh = grid_cells(shape)
            elif isinstance(shape, SolidRegion):
                mesh = meshed_solid_region(shape, sizes, order)
            else:
                mesh = meshed_region(shape, sizes, order)
            gmsh.clear()
            mesh.put()
            if mesh.order < order:
                model.mesh.setOrder(order)
        yield model
