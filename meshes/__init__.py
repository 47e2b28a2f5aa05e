"""Geometry in, gmsh mesh and tags out."""

from .region import Away, BoxGrid, Grid, Near, Region, SizeField, Sizes, SolidGrid, WallLayers
from .solid_region import PlacedSolid, Resolved, SolidFrame, SolidRegion

__all__ = [
    "Away",
    "BoxGrid",
    "Grid",
    "Near",
    "PlacedSolid",
    "Region",
    "Resolved",
    "SizeField",
    "Sizes",
]
__all__ += ["SolidFrame", "SolidGrid", "SolidRegion", "WallLayers"]
