"""What a free surface exerts on the flow within a time step; imported only where there is one."""

from __future__ import annotations

from typing import Any

import dolfinx
import ufl
from petsc4py import PETSc

from .. import compat
from ..forms.surface import SurfaceTerms, load
from ..mesh.domain import Domain
from .conditions import FreeSurface
from .space import TaylorHood


class SurfaceLoad:
    """The load of a free surface, by functions on the mesh's own nodes that a step sets. Making it is collective.

    Args:
        rate: coefficient a0 of the present elevation in its backward difference, UFL.

    Attributes:
        space: scalar functions on the mesh's own nodes.
        known, elevation, unfelt: see `forms.surface.SurfaceTerms`.
        measure: of the surface, exact for convection through straight facets.
    """

    def __init__(self, domain: Domain, flow: TaylorHood, condition: FreeSurface, rate: Any):
        mesh = domain.mesh
        self.condition, self.rate = condition, rate
        self.space = compat.function_space(mesh, compat.scalar_part(compat.coordinate_element(mesh)))
        self.known, self.elevation = (dolfinx.fem.Function(self.space) for _ in range(2))
        self.unfelt = dolfinx.fem.Function(self.space) if condition.pinned else None
        self._pressure = None if condition.pressure is None else dolfinx.fem.Function(self.space)
        self.gravity, self.origin, tension = (
            dolfinx.fem.Constant(mesh, PETSc.ScalarType(one))
            for one in (condition.gravity, condition.origin, condition.tension)
        )
        self.tension = tension if condition.tension > 0.0 else None
        self.measure = flow.boundary_quadrature(domain.facets)(domain.names[condition.boundary])
        self.place, self.normal = ufl.SpatialCoordinate(mesh), ufl.FacetNormal(mesh)

    def integral(self, v: Any, w: Any) -> Any:
        """The surface's part in the residual of momentum, tested with w, in UFL. Not collective."""
        terms = SurfaceTerms(
            *(self.gravity, self.origin, self.rate, self.known, self.elevation),
            *(self._pressure, self.tension, self.unfelt),
        )
        return load(v, w, self.place, self.normal, terms) * self.measure

    def update(self, time: float) -> None:
        """Evaluate the pressure above the surface at a time, where the mesh is now. Not collective."""
        if self._pressure is not None and self.condition.pressure is not None:
            points = self.space.tabulate_dof_coordinates()
            self._pressure.x.array[:] = self.condition.pressure(points.T, time)
