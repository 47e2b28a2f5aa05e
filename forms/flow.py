"""The residual of the flow, composed of the terms that the plan calls for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import ufl

from . import terms
from .kinematics import ReferenceMap, volume_before


@dataclass(frozen=True)
class FlowTerms:
    """What enters the residual; None, or an empty tuple, means that the term is absent from the generated code.

    viscosity:      kinematic viscosity, any expression, such as 1/Re
    rate:           time derivative at fixed X as an expression in the unknown velocity (None: steady)
    carrier:        velocity that convects, less that of the mesh where the mesh itself has been moved (None: Stokes)
    skew:           measure of the whole boundary for the energy-stable form of convection; None: as printed
    body_force:     force per unit mass that is not the gradient of a potential (gravity is absorbed in the pressure)
    cell_size:      size of a cell over the order of the velocity, for `terms.grad_div`; None: not stabilised
    upwind:         the same size for `terms.streamline_upwind`; None: not stabilised that way
    open_boundary:  measure of the boundary through which fluid leaves freely
    surface:        function of w that gives the integral over a free surface (`surface.load`)
    friction:       function of w and q that gives the integral over walls that resist the flow by a law
    reference_map:  None for the identity
    """

    viscosity: Any
    rate: Any = None
    carrier: Any = None
    skew: Any = None
    cell_size: Any = None
    upwind: Any = None
    body_force: Any = None
    open_boundary: Any = None
    reference_map: ReferenceMap | None = None
    surface: Callable[[Any], Any] | None = None
    friction: Callable[[Any, Any], Any] | None = None


def residual(v: Any, p: Any, w: Any, q: Any, present: FlowTerms, dx: Any) -> Any:
    """Weak residual of momentum and continuity, (338) and (339), tested with w and q over the measure dx.

    Raises:
        ValueError: the energy-stable form is asked for on a reference map; it is written for moved meshes.
    """
    x = present.reference_map
    if present.skew is not None and x is not None:
        raise ValueError("the energy-stable form is for a mesh that is itself moved, not for a reference map")
    integrand = terms.internal_force(v, p, w, present.viscosity, x) + terms.continuity(v, q, x)
    if present.rate is not None:
        integrand += terms.inertia(present.rate, w, x)
    if present.carrier is not None and present.skew is not None:
        integrand += terms.skew_convection(v, present.carrier, w)
    elif present.carrier is not None:
        integrand += terms.convection(v, present.carrier, w, x)
    if present.carrier is not None and present.cell_size is not None:
        integrand += terms.grad_div(v, present.carrier, w, present.viscosity, present.cell_size, x)
    if present.carrier is not None and present.upwind is not None:
        strong = terms.inviscid_momentum(v, p, present.carrier, present.rate, present.body_force, x)
        integrand += terms.streamline_upwind(strong, present.carrier, w, present.viscosity, present.upwind, x)
    if present.body_force is not None:
        integrand += terms.body_force(present.body_force, w, x)
    form = integrand * dx
    n = ufl.FacetNormal(w.ufl_domain())
    if present.carrier is not None and present.skew is not None:
        form += terms.through_boundary(v, present.carrier, w, n) * present.skew
    if present.open_boundary is not None:
        form += terms.open_boundary(v, w, n, present.viscosity, x) * present.open_boundary
    if present.friction is not None:
        form += present.friction(w, q)
    return form if present.surface is None else form + present.surface(w)


def vorticity(v: Any) -> Any:
    """curl v: a scalar in two dimensions, a vector in three."""
    return ufl.curl(v) if len(v) == 3 else v[1].dx(0) - v[0].dx(1)


def energy_stable_rate(coefficients: Any, velocities: Any, shifts: Any) -> Any:
    """Rate of change J dv/dt + (1/2) dJ/dt v on a mesh that has moved, for the energy-stable form.

    With J_k the volumes of the past states (see `volume_before`; one where there are no shifts) and a_k the
    coefficients of the backward difference it is sum a_k J_k v_k - (1/2) (sum a_k J_k) v. Of first order it is
    J_1 (v - v_1)/dt + (1/2) (1 - J_1)/dt v.
    """
    volumes = [1, *(volume_before(shift) for shift in shifts)] if shifts else [1] * len(velocities)
    terms_of_sum = list(zip(coefficients, volumes, velocities, strict=True))
    return (
        sum(a * J * u for a, J, u in terms_of_sum)
        - sum(a * J for a, J, _ in terms_of_sum) / 2 * velocities[0]
    )
