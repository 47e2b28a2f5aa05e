"""Geometry in, gmsh mesh and tags out."""

from .regions import SYMMETRY, Grid, PlacedSolid, Region, Resolved, SolidRegion, graded_ends
from .sizes import LAYERS_SHARE, Away, Near, SizeField, Sizes, WallLayers

__all__ = ["LAYERS_SHARE", "SYMMETRY", "Away", "Grid", "Near", "PlacedSolid", "Region", "Resolved"]
__all__ += ["SizeField", "Sizes", "SolidRegion", "WallLayers", "graded_ends"]
