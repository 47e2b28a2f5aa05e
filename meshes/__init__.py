"""Geometry in, gmsh mesh and tags out."""

from .region import Grid, Near, Region, SizeField, Sizes

__all__ = ["Grid", "Near", "Region", "SizeField", "Sizes"]
