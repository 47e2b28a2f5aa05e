"""Friction of walls with a law of the wall."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import dolfinx
import numpy as np
import ufl
from petsc4py import PETSc

from ..forms.kinematics import rigid_velocity
from ..forms.terms import friction, impermeable, layer, speed
from ..mesh.domain import Domain
from .conditions import Friction
from .space import TaylorHood, size_along

# Times k^2 nu/h: penalty of flow through a wall, k being the order of the elements, h the size of a cell across it.
HELD = 10.0


class WallLoad:
    """Loads of walls on the flow, with molecular and total viscosity (UFL). The constructor is collective."""

    def __init__(
        self,
        domain: Domain,
        flow: TaylorHood,
        walls: tuple[Friction, ...],
        viscosity: tuple[Any, Any],
        shear_velocity: Any,
    ):
        self._measure, self._names = flow.boundary_quadrature(domain.facets), domain.names
        self._normal, self._place = ufl.FacetNormal(domain.mesh), ufl.SpatialCoordinate(domain.mesh)
        self._held = HELD * flow.order**2 / size_along(domain.mesh, self._normal)
        self._viscosity, self._shear_velocity = viscosity, shear_velocity
        self._walls = {wall.boundary: (wall, flow.constant(wall.distance)) for wall in walls}
        gdim = domain.gdim
        # Of velocity, spin and the point where it moves so.
        sizes = gdim, 1 if gdim == 2 else 3, gdim
        self._motions = {
            wall.boundary: [
                dolfinx.fem.Constant(domain.mesh, np.zeros(size, dtype=PETSc.ScalarType))
                for size in sizes
            ]
            for wall in walls
            if wall.moves
        }

    def integral(self, v: Any, p: Any, rate: Any, w: Any, q: Any) -> Any:
        """Wall terms of the residual, tested with w and q, in UFL; `rate` is None in steady flow."""
        total, n, whole = 0, self._normal, self._viscosity[1]
        for name, (wall, distance) in self._walls.items():
            u = self.relative(v, name)
            if wall.axis is not None:
                load = self._rubbing(name, u, w) + layer(p, rate, w, distance)
            else:
                resistance = speed(u) + self._held * whole
                load = self._rubbing(name, u - ufl.inner(u, n) * n, w)
                load += impermeable(u, p, w, q, n, whole, resistance)
            total += load * self._measure(self._names[name])
        return total

    def stand(self, distances: Mapping[str, float]) -> None:
        """Set the distances of the law of the wall at body-fitted walls, by name."""
        for wall, held in self._walls.values():
            if wall.axis is None:
                held.value = distances[wall.boundary]

    def carry(
        self, boundary: str, velocity: np.ndarray, spin: np.ndarray, place: np.ndarray
    ) -> None:
        """Set velocity (gdim,) at a point `place` (gdim,), and spin (1,) or (3,), of a moving wall."""
        for constant, values in zip(self._motions[boundary], (velocity, spin, place), strict=True):
            constant.value[:] = values

    def _moved(self, boundary: str) -> Any:
        velocity, spin, place = self._motions[boundary]
        return rigid_velocity(velocity, spin, self._place - place)

    def relative(self, v: Any, boundary: str) -> Any:
        return v - self._moved(boundary) if boundary in self._motions else v

    def through(self, v: Any, q: Any, own: bool = True) -> Any:
        """(v . n) q over impermeable walls of any shape, their part of continuity, in UFL.

        v is relative to the walls, or absolute with `own` false.
        """
        n = self._normal
        return sum(
            ufl.inner(self.relative(v, wall.boundary) if own else v, n)
            * q
            * self._measure(self._names[wall.boundary])
            for wall, _ in self._walls.values()
            if wall.axis is None
        )

    def work(self, state: Any) -> Any:
        """Power of moving walls on the flow in UFL, or zero."""
        return sum(-self.power(state, self._moved(name), name) for name in self._motions)

    def power(self, state: Any, w: Any, boundary: str, held: bool = True) -> Any:
        """Power of the wall traction for the boundary velocity w, in UFL.

        For rigid w, minus the power of the flow's residual without its walls; with `held` false
        without the impermeability term.
        """
        v, p = ufl.split(state)
        v, n, whole = self.relative(v, boundary), self._normal, self._viscosity[1]
        rubbing = self._rubbing(boundary, v - ufl.inner(v, n) * n, w)
        normal = p - 2 * whole * ufl.inner(ufl.dot(ufl.grad(v), n), n)
        if held:
            normal += (speed(v) + self._held * whole) * ufl.inner(v, n)
        return (rubbing + normal * ufl.inner(w, n)) * self._measure(self._names[boundary])

    def _rubbing(self, boundary: str, along: Any, w: Any) -> Any:
        wall, distance = self._walls[boundary]
        drag = wall.drag(speed(along), self._shear_velocity, self._viscosity[0], distance)
        return friction(along, w, drag)
