"""UFL forms of the flow: one function a term, no assembly, no input or output, no PETSc."""

from .flow import (
    BodyForce,
    BoundaryLoad,
    Convection,
    FlowTerm,
    GradDiv,
    OpenBoundary,
    RateOfChange,
    StreamlineUpwind,
    Stress,
    Unknowns,
    energy_stable_rate,
    residual,
    vorticity,
)
from .kinematics import ReferenceMap, surface_vector, swept, volume_before
from .terms import stress, surface_traction

__all__ = [
    "BodyForce",
    "BoundaryLoad",
    "Convection",
    "FlowTerm",
    "GradDiv",
    "OpenBoundary",
    "RateOfChange",
    "ReferenceMap",
    "StreamlineUpwind",
    "Stress",
    "Unknowns",
    "energy_stable_rate",
    "residual",
    "stress",
    "surface_traction",
    "surface_vector",
    "swept",
    "volume_before",
    "vorticity",
]
