"""What walls that the mesh stands off from exert on the flow; imported only where there are any."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import dolfinx
import ufl
from petsc4py import PETSc

from ..forms.turbulence import friction
from ..mesh.domain import Domain
from .space import TaylorHood

if TYPE_CHECKING:
    from .conditions import Friction


class WallLoad:
    """The load of walls on the flow along them. Making it is collective.

    Args:
        viscosity: of the molecules, UFL.
    """

    def __init__(self, domain: Domain, flow: TaylorHood, walls: tuple[Friction, ...], viscosity: Any):
        self._measure, self._names = flow.boundary_quadrature(domain.facets), domain.names
        self._viscosity = viscosity
        self._walls = [
            (one, dolfinx.fem.Constant(domain.mesh, PETSc.ScalarType(one.distance))) for one in walls
        ]

    def integral(self, state: Any, w: Any) -> Any:
        """The walls' part in the residual of momentum of a mixed state, tested with w, in UFL. Not collective."""
        v, p = ufl.split(state)
        found = 0
        for wall, distance in self._walls:
            force = friction(v, p, w, self._law(wall, distance), distance)
            found += force * self._measure(self._names[wall.boundary])
        return found

    def _law(self, wall: Friction, distance: Any) -> Callable[[Any], Any]:
        """u* as a function of the speed."""
        return lambda speed: wall.shear_velocity(speed, self._viscosity, distance)
