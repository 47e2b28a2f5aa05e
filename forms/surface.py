"""The load of a free surface on the fluid, and the weak kinematic condition (337), for a graph.

n is the outward normal of the surface, on which the last coordinate is the still level plus the elevation. Its area
times n . up is the area below it, constant in time.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import ufl

LAYER = 0.1  # thickness of the layer of cells at the surface that a pressure there moves, in the size of a cell


@dataclass(eq=False)
class SurfaceTerms:
    """Terms of a free surface in the residual of the flow.

    gravity:   acceleration (gdim,), whose last component is negative or zero
    origin:    a position (gdim,) of the still level at which the pressure without the hydrostatic part is zero
    rate:      coefficient a0 of the present elevation in its backward difference
    known:     contribution of earlier elevations, -(a1 h(n) + a2 h(n-1))/a0
    elevation: of the present mesh
    unfelt:    weightless part of a pinned surface's elevation; None: not pinned
    place, normal: of the present mesh
    """

    gravity: Any
    origin: Any
    rate: Any
    known: Any
    elevation: Any
    unfelt: Any
    place: Any
    normal: Any


def load(v: Any, w: Any, surface: SurfaceTerms) -> Any:
    """Minus the power, in the velocity w, of what acts on the surface, as in the residual of momentum.

    The hydrostatic part is g h - b . (x - x0) along the level, with h as the velocity makes it in this step, known + v
    . n/(a0 n . up): gravity resists the velocity with g/a0 (v . n)(w . n)/(n . up), the surface's added mass.
    """
    up, n = len(v) - 1, surface.normal
    rise = surface.known + ufl.dot(v, n) / (surface.rate * n[up])
    head = -surface.gravity[up] * (rise if surface.unfelt is None else rise - surface.unfelt)
    for axis in range(up):
        head -= surface.gravity[axis] * (surface.place[axis] - surface.origin[axis])
    return head * ufl.dot(w, n)


def pressure(p: Any, q: Any, size: Any, surface: SurfaceTerms) -> Any:
    """The surface's term in the Laplacian that approximates a0 times the pressure's Schur complement: a0 p q/m.

    A pressure p raises the surface at the rate p/m: m has the added mass g/a0 and the inertia a0 size of a layer of
    cells. For preconditioners.
    """
    n, up = surface.normal, len(surface.normal) - 1
    return surface.rate**2 * n[up] / (-surface.gravity[up] + LAYER * surface.rate**2 * size) * p * q


def flux(v: Any, q: Any, n: Any) -> Any:
    """q v . n, of the kinematic condition int q (dh/dt (n . up) - v . n) ds = 0."""
    return q * ufl.dot(v, n)


def below(h: Any, q: Any, n: Any) -> Any:
    """q h (n . up), of the elevation or its rate in the kinematic condition."""
    return q * h * n[len(n) - 1]


def _slope(h: Any, axis: int, n: Any) -> Any:
    up = len(n) - 1
    return n[up] * h.dx(axis) - n[axis] * h.dx(up)


def carried(h: Any, q: Any, u: Any, n: Any) -> Any:
    """q u . grad h (n . up): an elevation carried along by the flow u."""
    return q * sum(u[axis] * _slope(h, axis, n) for axis in range(len(n) - 1))


def levelled(h: Any, q: Any, u: Any, n: Any, zone: Any) -> Any:
    """k grad h . grad q (n . up), k = |u| `zone` u along the level: a zone that levels the elevation."""
    horizontal = range(len(n) - 1)
    return (
        zone
        * _speed(u, n)
        / n[len(n) - 1]
        * sum(_slope(h, axis, n) * _slope(q, axis, n) for axis in horizontal)
    )


def returned(h: Any, q: Any, u: Any, n: Any, zone: Any) -> Any:
    """r h q (n . up), r = |u| `zone`: an elevation returns to the still level in a zone."""
    return zone * _speed(u, n) * below(h, q, n)


def _speed(u: Any, n: Any) -> Any:
    return ufl.sqrt(sum(u[axis] ** 2 for axis in range(len(n) - 1)))


def crossing(v: Any, surface: SurfaceTerms) -> Any:
    """((v - v_mesh) . n)^2."""
    n, moved = surface.normal, surface.elevation - surface.known
    return (ufl.dot(v, n) - surface.rate * moved * n[len(v) - 1]) ** 2


def potential(surface: SurfaceTerms) -> Any:
    """Potential energy above that of the still level, g h^2/2 - b . (x - x0) h along it, times n . up."""
    up, gravity = len(surface.normal) - 1, surface.gravity
    density = -gravity[up] * surface.elevation**2 / 2
    for axis in range(up):
        density -= gravity[axis] * (surface.place[axis] - surface.origin[axis]) * surface.elevation
    return density * surface.normal[up]
