"""Steady and unsteady runs of a scene."""
