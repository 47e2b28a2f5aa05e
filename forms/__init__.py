"""UFL forms of the flow: one function a term."""

from .kinematics import ReferenceMap, surface_vector
from .terms import stress, surface_traction, vorticity

__all__ = ["ReferenceMap", "stress", "surface_traction", "surface_vector", "vorticity"]
