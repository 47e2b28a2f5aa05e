"""Grains and beds in 3-D."""
