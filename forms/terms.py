"""Terms of the weak momentum and continuity equations (338), (339), one a function.

Each returns the integrand, tested with w (velocity) or q (pressure), over the reference domain, as on the left-hand
side. The kinematic `viscosity` (fluid density one) is any UFL expression.
"""

from __future__ import annotations

from typing import Any

import ufl

from .kinematics import (
    ReferenceMap,
    divergence,
    gradient,
    laplacian,
    rate_of_strain,
    surface_vector,
    weighted,
)

# Reynolds number of a cell, per order, up to which it resolves the flow without help: P0 of `grad_div`.
RESOLVED = 10.0
SLOWEST = 1e-12  # speed at which friction still has a derivative


def stress(v: Any, p: Any, viscosity: Any, reference_map: ReferenceMap) -> Any:
    """Cauchy stress sigma = -p I + 2 nu D."""
    return -p * ufl.Identity(len(v)) + 2 * viscosity * rate_of_strain(v, reference_map)


def inertia(rate: Any, w: Any, reference_map: ReferenceMap) -> Any:
    """J dv/dt|_X . w, where `rate` is the time derivative at fixed X."""
    return weighted(ufl.inner(rate, w), reference_map)


def convection(v: Any, carrier: Any, w: Any, reference_map: ReferenceMap) -> Any:
    """J [grad(v) F^-1 (u - v_mesh)] . w, carried by the velocity u (`carrier`): v, or its extrapolation."""
    carrier = carrier - reference_map.velocity
    return weighted(ufl.inner(ufl.dot(gradient(v, reference_map), carrier), w), reference_map)


def grad_div(
    v: Any,
    carrier: Any,
    w: Any,
    viscosity: Any,
    size: Any,
    reference_map: ReferenceMap,
) -> Any:
    """J gamma div(v) div(w), gamma = nu P^3/(P0^2 + P^2) with the Reynolds number of cells P = |c| size/nu.

    Consistent and dissipative. `size` is a cell's over the order of the velocity, on the domain of X. Source:
    Olshanskii, Lube, Heister & Loewe (2009), Comput. Methods Appl. Mech. Engrg. 198, 3975; the dependence on P is
    measured (docs/contribute/defaults.md).
    """
    carrier = carrier - reference_map.velocity
    size = size * reference_map.J ** (1 / len(v))
    square = ufl.inner(carrier, carrier) * (size / viscosity) ** 2
    gamma = viscosity * square**1.5 / (RESOLVED**2 + square)
    return weighted(
        gamma * divergence(v, reference_map) * divergence(w, reference_map), reference_map
    )


def streamline_upwind(
    strong: Any,
    carrier: Any,
    w: Any,
    viscosity: Any,
    size: Any,
    reference_map: ReferenceMap,
) -> Any:
    """J delta r . (c . grad w): the residual r (`strong`) of momentum also tested along streamlines (SUPG).

    delta is `streamline_time` with the `size` of cells over the order. Source: Brooks & Hughes (1982), Comput. Methods
    Appl. Mech. Engrg. 32, 199.
    """
    carrier = carrier - reference_map.velocity
    size = size * reference_map.J ** (1 / len(carrier))
    along = ufl.dot(gradient(w, reference_map), carrier)
    return weighted(
        streamline_time(carrier, viscosity, size) * ufl.inner(strong, along), reference_map
    )


def momentum(
    v: Any,
    p: Any,
    carrier: Any,
    viscosity: Any,
    rate: Any,
    force: Any,
    reference_map: ReferenceMap,
) -> Any:
    """dv/dt + c . grad v + grad p - nu div grad v - b, nu constant; viscosity, rate and force may be None."""
    carrier = carrier - reference_map.velocity
    strong = ufl.dot(gradient(v, reference_map), carrier) + gradient(p, reference_map)
    if viscosity is not None:
        strong -= viscosity * laplacian(v, reference_map)
    if rate is not None:
        strong += rate
    return strong if force is None else strong - force


def streamline_time(carrier: Any, viscosity: Any, size: Any) -> Any:
    """h/(2 |c|) (1 - 1/Pe) where the cell's Peclet number Pe = |c| h/(2 nu) is above one, otherwise zero.

    Source: Elman, Silvester & Wathen (2014), Finite Elements and Fast Iterative Solvers, section 6.3.2.
    """
    speed = ufl.sqrt(ufl.inner(carrier, carrier))
    peclet = speed * size / (2 * viscosity)
    return ufl.conditional(ufl.gt(peclet, 1), size / (2 * speed) * (1 - 1 / peclet), 0)


def internal_force(v: Any, p: Any, w: Any, viscosity: Any, reference_map: ReferenceMap) -> Any:
    """P : grad w with P = J sigma F^-T, the weak form of -div P."""
    strain_v, strain_w = rate_of_strain(v, reference_map), rate_of_strain(w, reference_map)
    viscous = 2 * viscosity * ufl.inner(strain_v, strain_w)
    return weighted(viscous - p * divergence(w, reference_map), reference_map)


def continuity(v: Any, q: Any, reference_map: ReferenceMap) -> Any:
    """-J (grad(v) : F^-T) q; J and the sign make the Stokes operator symmetric."""
    return -weighted(divergence(v, reference_map) * q, reference_map)


def body_force(b: Any, w: Any, reference_map: ReferenceMap) -> Any:
    """-J b . w, b being (X/V^2) b, a force per unit mass."""
    return -weighted(ufl.inner(b, w), reference_map)


def open_boundary(v: Any, w: Any, n: Any, viscosity: Any, reference_map: ReferenceMap) -> Any:
    """-nu (grad(v)^T n - div(v) n) . w on an open boundary, so that a parallel flow leaves it undisturbed.

    The natural condition then is -p n + nu dv/dn = 0 instead of sigma n = 0, which bends streamlines (Heywood,
    Rannacher & Turek 1996). Without the vanishing div v half an order of the velocity is lost.
    """
    normal = surface_vector(n, reference_map)
    shear = ufl.dot(gradient(v, reference_map).T, normal) - divergence(v, reference_map) * normal
    return -viscosity * ufl.inner(shear, w)


def impermeable(v: Any, p: Any, w: Any, q: Any, n: Any, viscosity: Any, resistance: Any) -> Any:
    """-(n . sigma(v, p) n) w . n - (n . sigma(w, q) n) v . n + b v . n w . n on a wall of any shape.

    Nitsche's method (1971, Abh. Math. Sem. Hamburg 36, 9), for slip as Freund & Stenberg (1995, Proc. 9th Int. Conf.
    Finite Elements in Fluids, 327). The resistance b is the flow's velocity, so that leakage brings no energy, plus
    nu/h with a factor that grows with the square of the elements' order.
    """
    of_flow, of_tests = (
        2 * viscosity * ufl.inner(ufl.dot(ufl.grad(velocity), n), n) - pressure
        for velocity, pressure in ((v, p), (w, q))
    )
    through = ufl.inner(w, n)
    return -of_flow * through + (resistance * through - of_tests) * ufl.inner(v, n)


def speed(v: Any) -> Any:
    """|v|, with a derivative where the fluid is at rest."""
    return ufl.sqrt(ufl.inner(v, v) + SLOWEST**2)


def friction(v: Any, w: Any, drag: Any) -> Any:
    """c v . w: the shear stress of a wall, c times the velocity along it."""
    return drag * ufl.inner(v, w)


def layer(p: Any, rate: Any, w: Any, distance: Any) -> Any:
    """y (dv/dt + grad p) . w: the layer between the boundary and a wall y beyond accelerates as its edge does.

    `rate` stands for dv/dt; None in a steady flow.
    """
    pushed = ufl.grad(p) if rate is None else ufl.grad(p) + rate
    return distance * ufl.inner(pushed, w)


def entering_boundary(v: Any, carrier: Any, w: Any, n: Any) -> Any:
    """-min(c . n, 0) v . w where fluid enters through an end, its velocity along n being given.

    With `open_boundary` (c . n) v = nu dv/dn across n: the inflow brings no momentum across the flow, and so no kinetic
    energy (Braack & Mucha 2014, J. Comput. Math. 32, 507).
    """
    inwards = ufl.conditional(ufl.lt(ufl.dot(carrier, n), 0), ufl.dot(carrier, n), 0)
    return -inwards * ufl.inner(v, w)


def relaxation(v: Any, base_flow: Any, rate: Any, w: Any) -> Any:
    """s (v - u) . w: relaxation to the base flow u at a rate s, zero outside of a sponge."""
    return rate * ufl.inner(v - base_flow, w)


def surface_traction(v: Any, p: Any, n: Any, viscosity: Any, reference_map: ReferenceMap) -> Any:
    """sigma n per unit of reference area: with n out of the body the traction of the fluid on it."""
    return ufl.dot(stress(v, p, viscosity, reference_map), surface_vector(n, reference_map))


def vorticity(v: Any) -> Any:
    """curl v: a scalar in two dimensions, a vector in three."""
    return ufl.curl(v) if len(v) == 3 else v[1].dx(0) - v[0].dx(1)


# -- scalar operators that approximate blocks of the Jacobian in preconditioners --------------------


def velocity_component(
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
        integrand += inertia(rate * u, w, at)
    if carrier is not None:
        along = ufl.dot(gradient(u, at), carrier - at.velocity)
        integrand += convection(u, carrier, w, at)
        integrand += streamline_upwind(along, carrier, w, viscosity, size, at)
    return integrand


def pressure_mass(p: Any, q: Any, viscosity: Any, reference_map: ReferenceMap) -> Any:
    """p q/nu: the Schur complement of Stokes flow up to a bounded factor (Silvester & Wathen 1994)."""
    return weighted(p * q / viscosity, reference_map)


def upwinded_viscosity(viscosity: Any, carrier: Any, size: Any, share: float) -> Any:
    """nu + share tau |c|^2: with a fraction of that of `streamline_upwind` along c."""
    return viscosity + share * streamline_time(carrier, viscosity, size) * ufl.dot(carrier, carrier)


def pressure_laplacian(p: Any, q: Any, reference_map: ReferenceMap) -> Any:
    """grad p . grad q: the Schur complement of flow dominated by inertia (Cahouet & Chabard 1988)."""
    return weighted(
        ufl.inner(gradient(p, reference_map), gradient(q, reference_map)), reference_map
    )
