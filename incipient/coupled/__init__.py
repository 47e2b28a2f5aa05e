"""Coupling of fluid and grain: tractions, iteration within a step, remeshing, energy."""
