"""Fluid and grain together: tractions, the iteration within a step, new meshes, energy."""
