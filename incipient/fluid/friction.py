"""What walls that resist a turbulent flow exert on it; imported only where there are any."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import ufl

from ..forms.terms import impermeable
from ..forms.turbulence import friction, layer, speed
from ..mesh.domain import Domain
from .space import TaylorHood, cell_size

if TYPE_CHECKING:
    from .conditions import Friction

HELD = 10.0  # times k^2 nu/h: what resists a flow through a wall, k being the order of the elements


class WallLoad:
    """The load of walls on the flow. Making it is collective.

    Args:
        viscosity: of the molecules, and with the eddies, UFL.
        shear_velocity: that the turbulence stands for (`forms.turbulence.shear_velocity`), UFL.
    """

    def __init__(
        self,
        domain: Domain,
        flow: TaylorHood,
        walls: tuple[Friction, ...],
        viscosity: tuple[Any, Any],
        shear_velocity: Any,
    ):
        self._measure, self._names = flow.boundary_quadrature(domain.facets), domain.names
        self._normal, self._held = ufl.FacetNormal(domain.mesh), HELD * flow.order**2 / cell_size(domain.mesh)
        self._viscosity, self._shear_velocity = viscosity, shear_velocity
        self._walls = [(one, flow.constant(one.distance)) for one in walls]

    def integral(self, state: Any, rate: Any, w: Any, q: Any) -> Any:
        """The walls' part in the residual of a mixed state, tested with w and q, in UFL. Not collective.

        `rate` is that at which the velocity changes; None in a steady flow.
        """
        v, p = ufl.split(state)
        return sum(
            self._of(wall, distance, (v, p, rate), (w, q)) * self._measure(self._names[wall.boundary])
            for wall, distance in self._walls
        )

    def stand(self, distance: float) -> None:
        """Let walls that bound the mesh themselves have another distance of the law. Not collective."""
        for wall, held in self._walls:
            if wall.axis is None:
                held.value = distance

    def power(self, state: Any, w: Any, boundary: str, held: bool = True) -> Any:
        """Of the traction of the flow on a wall of any shape, in a motion w of that boundary, in UFL. Not collective.

        In rigid motions it is minus that of the flow's residual without its walls, as no shape of w enters. Without
        what holds the flow from crossing the wall it is that of pressure, viscous normal stress and the law's friction.
        """
        v, p = ufl.split(state)
        (wall, distance), n = self._at(boundary), self._normal
        of_molecules, whole = self._viscosity
        along = v - ufl.inner(v, n) * n
        rubbing = friction(along, w, wall.drag(speed(along), self._shear_velocity, of_molecules, distance))
        normal = p - 2 * whole * ufl.inner(ufl.dot(ufl.grad(v), n), n)
        if held:
            normal += (speed(v) + self._held * whole) * ufl.inner(v, n)
        return (rubbing + normal * ufl.inner(w, n)) * self._measure(self._names[boundary])

    def _at(self, boundary: str) -> tuple[Friction, Any]:
        return next(one for one in self._walls if one[0].boundary == boundary)

    def _of(self, wall: Friction, distance: Any, flow: Sequence[Any], tests: Sequence[Any]) -> Any:
        """The integrand at one wall."""
        (v, p, rate), (w, q) = flow, tests
        of_molecules, whole = self._viscosity
        n, beside = self._normal, wall.axis is not None
        along = v if beside else v - ufl.inner(v, n) * n
        rubbing = friction(along, w, wall.drag(speed(along), self._shear_velocity, of_molecules, distance))
        if beside:
            return rubbing + layer(p, rate, w, distance)
        return rubbing + impermeable(v, p, w, q, n, whole, speed(v) + self._held * whole)
