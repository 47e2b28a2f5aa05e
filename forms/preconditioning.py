"""Scalar operators that stand for blocks of the flow's Jacobian in preconditioners: integrands of bilinear forms."""

from __future__ import annotations

from typing import Any

import ufl

from .kinematics import ReferenceMap, gradient, weighted


def component(
    u: Any,
    w: Any,
    viscosity: Any,
    rate: Any = None,
    carrier: Any = None,
    size: Any = None,
    reference_map: ReferenceMap | None = None,
) -> Any:
    """Momentum of one velocity component u, tested with w: nu grad u . grad w + a0 u w + (c . grad u) w.

    `rate` is the coefficient a0 of u in its rate of change, `carrier` the velocity c that convects (either None:
    absent). With the `size` of cells convection is stabilised by `streamline_diffusion`. The components are
    coupled by the symmetric gradient only, which by Korn's inequality is equivalent to the plain one.
    """
    integrand = viscosity * ufl.inner(gradient(u, reference_map), gradient(w, reference_map))
    if rate is not None:
        integrand += rate * u * w
    if carrier is not None:
        if reference_map is not None:
            carrier = carrier - reference_map.velocity
        along = ufl.dot(gradient(u, reference_map), carrier)
        integrand += along * w
        if size is not None:
            delta = streamline_diffusion(carrier, viscosity, size)
            integrand += delta * along * ufl.dot(gradient(w, reference_map), carrier)
    return weighted(integrand, reference_map)


def streamline_diffusion(carrier: Any, viscosity: Any, size: Any) -> Any:
    """h/(2 |c|) (1 - 1/Pe) where the cell's Peclet number Pe = |c| h/(2 nu) is above one, else zero.

    Source: Elman, Silvester & Wathen (2014), Finite Elements and Fast Iterative Solvers, section 6.3.2.
    """
    speed = ufl.sqrt(ufl.inner(carrier, carrier))
    peclet = speed * size / (2 * viscosity)
    return ufl.conditional(ufl.gt(peclet, 1), size / (2 * speed) * (1 - 1 / peclet), 0)


def pressure_mass(p: Any, q: Any, viscosity: Any, reference_map: ReferenceMap | None = None) -> Any:
    """p q/nu: the Schur complement of Stokes flow up to a bounded factor (Silvester & Wathen 1994)."""
    return weighted(p * q / viscosity, reference_map)


def pressure_laplacian(p: Any, q: Any, reference_map: ReferenceMap | None = None) -> Any:
    """grad p . grad q: the Schur complement of flow dominated by its inertia (Cahouet & Chabard 1988)."""
    return weighted(ufl.inner(gradient(p, reference_map), gradient(q, reference_map)), reference_map)
