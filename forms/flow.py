"""The residual of the flow, composed of the terms that the plan calls for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import ufl

from . import terms
from .kinematics import ReferenceMap


@dataclass(frozen=True)
class FlowTerms:
    """What enters the residual; None, or an empty tuple, means that the term is absent from the generated code.

    rate:           time derivative at fixed X as an expression in the unknown velocity (None: steady)
    carrier:        velocity that convects (None: Stokes)
    body_force:     force per unit mass that is not the gradient of a potential (gravity is absorbed in the pressure)
    open_boundary:  measure of the boundary through which fluid leaves freely
    reference_map:  None for the identity
    """

    reynolds: Any
    rate: Any = None
    carrier: Any = None
    body_force: Any = None
    open_boundary: Any = None
    reference_map: ReferenceMap | None = None


def residual(v: Any, p: Any, w: Any, q: Any, present: FlowTerms, dx: Any) -> Any:
    """Weak residual of momentum and continuity, (338) and (339), tested with w and q over the measure dx."""
    x = present.reference_map
    integrand = terms.internal_force(v, p, w, present.reynolds, x) + terms.continuity(v, q, x)
    if present.rate is not None:
        integrand += terms.inertia(present.rate, w, x)
    if present.carrier is not None:
        integrand += terms.convection(v, present.carrier, w, x)
    if present.body_force is not None:
        integrand += terms.body_force(present.body_force, w, x)
    form = integrand * dx
    if present.open_boundary is not None:
        n = ufl.FacetNormal(w.ufl_domain())
        form += terms.open_boundary(v, w, n, present.reynolds, x) * present.open_boundary
    return form


def vorticity(v: Any) -> Any:
    """curl v: a scalar in two dimensions, a vector in three."""
    return ufl.curl(v) if len(v) == 3 else v[1].dx(0) - v[0].dx(1)
