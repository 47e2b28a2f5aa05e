"""An end of a channel below a free surface, through which a given amount of fluid enters or leaves per time."""

from __future__ import annotations

from typing import Any

import dolfinx
import numpy as np
import ufl

from .. import compat
from ..compat import PETSc, petsc
from ..mesh.domain import Domain
from .conditions import Entering
from .space import TaylorHood


class Entry:
    """The velocity along the normal of an end, whose profile is stretched with the depth. Every method is collective.

    A node has the velocity of the place at which the mesh was made, times a factor that is the same for all of them:
    by it the discharge is that through the end as it was made, whatever the depth is now.

    Args:
        domain: whose mesh is as it was made.
        condition: of the end.
        walls: names of boundaries at which the fluid sticks; it does so in the corners, too.

    Attributes:
        boundary, axis, given, wave: those of the condition.
        space: of a component of the velocity.
        values: of it, with the velocity on the boundary.
        influx: volume flux through the mesh as it was at the last `update`.
    """

    def __init__(
        self,
        domain: Domain,
        space: TaylorHood,
        condition: Entering,
        walls: tuple[str, ...],
    ):
        boundary, axis, mesh = condition.boundary, condition.axis, domain.mesh
        self.boundary, self.axis, self._velocity = boundary, axis, condition.velocity
        self.given, self.wave, self._level = condition.given, condition.wave, condition.level
        self.space = compat.space(mesh, ("Lagrange", space.order))
        self.values, self.influx = dolfinx.fem.Function(self.space), 0.0
        still = [compat.nodes_on(self.space, domain.facets_of(name)) for name in walls]
        on = compat.nodes_on(self.space, domain.facets_of(boundary))
        self._nodes = np.setdiff1d(on, np.concatenate([np.empty(0, dtype=np.int32), *still]))
        self._places = self.space.tabulate_dof_coordinates()[self._nodes].T.copy()
        self._own = self._nodes[self._nodes < self.space.dofmap.index_map.size_local]
        self._count, self._comm = len(self._own), domain.comm
        inwards = -ufl.FacetNormal(mesh)[axis]
        measure = space.boundary_quadrature(domain.facets)(domain.names[boundary])
        ends = domain.comm.allgather(self._places[axis, :1].tolist())
        self._end = next(one for some in ends for one in some)
        self._form = compat.form(ufl.inner(inwards, ufl.TestFunction(self.space)) * measure)
        self._made = self._areas()

    def update(self, t: float) -> None:
        """Evaluate the velocity at a time, where the mesh is now."""
        asked, now = np.asarray(self._velocity(self._places, t)), self._areas()
        mine = asked[: self._count]
        sums = np.array([abs(mine) @ self._made, abs(mine) @ now, mine @ now])
        made, stretched, through = self._comm.allreduce(sums)
        factor = float(made / stretched) if stretched else 1.0
        self.values.x.array[self._nodes] = factor * asked
        self.influx = factor * float(through)

    def zone(self, place: Any) -> Any:
        """The length of the level zone at the end, which falls to zero along it, in UFL. Not collective."""
        rest = 1 - abs(place[self.axis] - self._end) / self._level
        return self._level * ufl.conditional(ufl.gt(rest, 0), rest**2, 0)

    def rate(self, place: Any) -> Any:
        """The zone's length over its square at the end, the weight of the prescribed level, in UFL. Not collective."""
        return self.zone(place) / self._level**2

    def _areas(self) -> np.ndarray:
        """(own nodes of the boundary,) the integral of each one's function over it, counted inwards."""
        vector = petsc.assemble_vector(self._form)
        vector.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
        found = np.array(vector.array_r[self._own])
        vector.destroy()
        return found
