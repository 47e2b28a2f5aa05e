"""Geometry in, gmsh mesh and tags out."""

from .region import Away, Grid, Near, Region, SizeField, Sizes

__all__ = ["Away", "Grid", "Near", "Region", "SizeField", "Sizes"]
