"""Grains and beds in 2-D."""
