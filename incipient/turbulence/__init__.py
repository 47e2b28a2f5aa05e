"""Turbulence by the k-epsilon model: k and epsilon on a mesh, and their iteration with the flow."""

from .coupled import InTime, Round, solve_steadily
from .fields import Surroundings, Turbulence

__all__ = ["InTime", "Round", "Surroundings", "Turbulence", "solve_steadily"]
