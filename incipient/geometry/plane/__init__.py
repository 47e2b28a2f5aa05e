"""Grains and beds in the plane."""
