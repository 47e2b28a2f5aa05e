"""Scalar operators that approximate blocks of the flow's Jacobian in preconditioners."""

from __future__ import annotations

from typing import Any

import ufl

from . import terms
from .kinematics import ReferenceMap, gradient, weighted


def component(
    u: Any,
    w: Any,
    reference_map: ReferenceMap,
    viscosity: Any,
    rate: Any,
    carrier: Any,
    size: Any,
) -> Any:
    """Momentum of one velocity component u, tested with w: nu grad u . grad w + a0 u w + (c . grad u) w, upwinded.

    `rate` is a0, `carrier` the velocity c (None: absent), `size` that of cells over the order. By Korn's inequality
    the coupled symmetric gradient is equivalent to the plain one.
    """
    at = reference_map
    integrand = weighted(viscosity * ufl.inner(gradient(u, at), gradient(w, at)), at)
    if rate is not None:
        integrand += terms.inertia(rate * u, w, at)
    if carrier is not None:
        along = ufl.dot(gradient(u, at), carrier - at.velocity)
        integrand += terms.convection(u, carrier, w, at)
        integrand += terms.streamline_upwind(along, carrier, w, viscosity, size, at)
    return integrand


def pressure_mass(p: Any, q: Any, viscosity: Any, reference_map: ReferenceMap) -> Any:
    """p q/nu: the Schur complement of Stokes flow up to a bounded factor (Silvester & Wathen 1994)."""
    return weighted(p * q / viscosity, reference_map)


def upwinded_viscosity(viscosity: Any, carrier: Any, size: Any, share: float) -> Any:
    """nu + share tau |c|^2: with a fraction of that of `terms.streamline_upwind` along c."""
    return viscosity + share * terms.streamline_time(carrier, viscosity, size) * ufl.dot(
        carrier, carrier
    )


def pressure_laplacian(p: Any, q: Any, reference_map: ReferenceMap) -> Any:
    """grad p . grad q: the Schur complement of flow dominated by inertia (Cahouet & Chabard 1988)."""
    return weighted(
        ufl.inner(gradient(p, reference_map), gradient(q, reference_map)), reference_map
    )
