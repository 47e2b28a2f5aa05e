"""Geometry in, gmsh mesh and tags out."""

from .region import Grid, Near, Region, Sizes

__all__ = ["Grid", "Near", "Region", "Sizes"]
