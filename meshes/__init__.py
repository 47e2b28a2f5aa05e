"""Geometry in, gmsh mesh and tags out."""

from .regions import (
    LAYERS_SHARE,
    SYMMETRY,
    Away,
    Grid,
    Near,
    PlacedSolid,
    Region,
    Resolved,
    SizeField,
    Sizes,
    SolidRegion,
    WallLayers,
    graded_ends,
)

__all__ = ["LAYERS_SHARE", "SYMMETRY", "Away", "Grid", "Near", "PlacedSolid", "Region", "Resolved"]
__all__ += ["SizeField", "Sizes", "SolidRegion", "WallLayers", "graded_ends"]
