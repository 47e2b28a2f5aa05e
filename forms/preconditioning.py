"""Scalar operators that approximate blocks of the flow's Jacobian in preconditioners."""

from __future__ import annotations

from typing import Any

import ufl

from .kinematics import ReferenceMap, gradient, weighted
from .terms import streamline_time


def component(
    u: Any,
    w: Any,
    reference_map: ReferenceMap,
    viscosity: Any,
    rate: Any = None,
    carrier: Any = None,
    size: Any = None,
) -> Any:
    """Momentum of one velocity component u, tested with w: nu grad u . grad w + a0 u w + (c . grad u) w.

    `rate` is a0, `carrier` the velocity c (None: absent); with the `size` of cells convection is stabilised as by
    `terms.streamline_upwind`. By Korn's inequality the coupled symmetric gradient is equivalent to the plain one.
    """
    integrand = 0 * u * w if rate is None else rate * u * w
    if viscosity is not None:
        integrand += viscosity * ufl.inner(gradient(u, reference_map), gradient(w, reference_map))
    if carrier is not None:
        carrier = carrier - reference_map.velocity
        along = ufl.dot(gradient(u, reference_map), carrier)
        integrand += along * w
        if size is not None:
            size = size * reference_map.J ** (1 / len(carrier))
            integrand += (
                streamline_time(carrier, viscosity, size)
                * along
                * ufl.dot(gradient(w, reference_map), carrier)
            )
    return weighted(integrand, reference_map)


def pressure_mass(p: Any, q: Any, viscosity: Any, reference_map: ReferenceMap) -> Any:
    """p q/nu: the Schur complement of Stokes flow up to a bounded factor (Silvester & Wathen 1994)."""
    return weighted(p * q / viscosity, reference_map)


def upwinded_viscosity(viscosity: Any, carrier: Any, size: Any, share: float) -> Any:
    """nu + share tau |c|^2: with a fraction of that of `terms.streamline_upwind` along c."""
    return viscosity + share * streamline_time(carrier, viscosity, size) * ufl.dot(carrier, carrier)


def pressure_laplacian(p: Any, q: Any, reference_map: ReferenceMap) -> Any:
    """grad p . grad q: the Schur complement of flow dominated by inertia (Cahouet & Chabard 1988)."""
    return weighted(
        ufl.inner(gradient(p, reference_map), gradient(q, reference_map)), reference_map
    )
