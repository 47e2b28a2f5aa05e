"""Grains and beds in space."""
