"""UFL forms of the flow: one function a term, no assembly, no input or output, no PETSc."""

from .flow import FlowTerms, residual, vorticity
from .kinematics import ReferenceMap, surface_vector
from .terms import stress, surface_traction

__all__ = [
    "FlowTerms",
    "ReferenceMap",
    "residual",
    "stress",
    "surface_traction",
    "surface_vector",
    "vorticity",
]
