"""Derived parts of a scene before any decision or mesh: geometry, base flow, dimensionless numbers."""
