"""Load of a free surface on the flow within a time step."""

from __future__ import annotations

from typing import Any

import dolfinx
import ufl
from petsc4py import PETSc

from .. import compat
from ..forms import terms
from ..forms.surface import SurfaceTerms, load, pressure
from .conditions import Constraints, FreeSurface
from .space import TaylorHood, cell_size


class SurfaceLoad(SurfaceTerms):
    """Load of a free surface on the flow, with a sponge. The constructor is collective.

    `rate`: coefficient a0 of the present elevation in its backward difference, UFL.
    """

    def __init__(self, flow: TaylorHood, held: Constraints, condition: FreeSurface, rate: Any):
        domain, mesh = held.domain, held.domain.mesh
        self.condition = condition
        self.space = compat.function_space(
            mesh, compat.scalar_part(compat.coordinate_element(mesh))
        )
        super().__init__(
            gravity=dolfinx.fem.Constant(mesh, PETSc.ScalarType(condition.gravity)),
            origin=dolfinx.fem.Constant(mesh, PETSc.ScalarType(condition.origin)),
            rate=rate,
            known=dolfinx.fem.Function(self.space),
            elevation=dolfinx.fem.Function(self.space),
            unfelt=dolfinx.fem.Function(self.space) if condition.pinned else None,
            place=ufl.SpatialCoordinate(mesh),
            normal=ufl.FacetNormal(mesh),
        )
        self.measure = flow.boundary_quadrature(domain.facets)(domain.names[condition.boundary])
        if condition.sponge is not None:
            self._base_flow = dolfinx.fem.Function(flow.velocity)
            values = condition.sponge.base_flow(flow.velocity_points().T, 0.0)
            self._base_flow.x.array.reshape(-1, flow.gdim)[:] = values.T

    def integral(self, v: Any, w: Any) -> Any:
        residual = load(v, w, self) * self.measure
        if (sponge := self.condition.sponge) is not None:
            within = (self.place[0] - sponge.start) / (sponge.end - sponge.start)
            rate = sponge.rate * ufl.conditional(ufl.gt(within, 0), within**2, 0)
            residual += terms.relaxation(v, self._base_flow, rate, w) * ufl.dx
        return residual

    def of_pressure(self, p: Any, q: Any) -> Any:
        """Surface term in the Laplacian of the pressure's Schur complement, in UFL."""
        return pressure(p, q, cell_size(self.space.mesh), self) * self.measure
