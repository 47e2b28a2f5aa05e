"""Regions and grids meshed, with their boundaries named."""

from .grids import grid_cells
from .plane import meshed_region
from .regions import Grid, Region, SolidRegion
from .session import session
from .simplices import Simplices
from .sizes import Sizes
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
