"""Remeshing during a run, with transfer of fields, past states and past mesh positions.

Transferred velocities get boundary values and are projected onto divergence-free ones, each on the mesh of its time.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import dolfinx
import numpy as np
import ufl

from .. import compat
from ..arrays import Floats, spatial
from ..compat import petsc
from ..errors import MeshError
from ..fluid import Fluid
from ..fluid.space import geometry_function, geometry_rows
from ..fluid.transient import Past
from ..forms.terms import continuity, inertia
from ..mesh.sampling import Transfer, transferred
from ..parallel import Owner
from .coupling import Coupling
from .rigid import RigidPart

# Relative change of the velocity by the projection above which the new mesh is too coarse.
LARGEST_CHANGE = 0.1
# Largest barycentric extrapolation out of an old cell. Meshes differ in the interstices between the spheres of a bed:
# without a limit velocities there reached half of the largest one, and no step converged at u* d/nu = 133.
REACH = 0.25


def carry_over(
    before: Coupling, coupling: Coupling, body: RigidPart, states: Sequence[Past]
) -> tuple[list[Past], dict[str, Any]]:
    """Transfer states of the fluid, the present one first, to the new fluid and its coupling with a body. Collective.

    Sets the new fluid's present state and returns all states on the new mesh; and time, number of cells, their worst
    quality, and relative change of the velocity by projection. Raises MeshError if the new mesh is folded or too
    coarse; the old fluid is unchanged.
    """
    fluid = coupling.fluid
    fluid.time = before.fluid.time
    coupling.places = _places(before, fluid)
    known = _states([past.state for past in states], before.fluid, fluid)
    carried, changes = [], []
    with Projection(fluid) as projection:
        for k, (past, state) in enumerate(zip(states, known, strict=True)):
            # A fluid at rest remains so, despite impulsively started boundaries.
            if k < len(coupling.places) and before.fluid.speed(past.state) > 0.0:
                fluid.move_mesh(coupling.places[k])
                fluid.state.x.array[:] = state
                fluid.constraints.update(body.past[k].time)
                body.lend(body.past[k])
                compat.impose(fluid.state.x.array, fluid.constraints.dirichlet)
                changes.append(projection.apply())
                state = fluid.state.x.array.copy()
            carried.append(Past(past.time, state, past.velocities))
    fluid.move_mesh(coupling.places[0])
    fluid.state.x.array[:] = carried[0].state
    topology = fluid.domain.mesh.topology
    quality, change = coupling.motion.quality().worst, max(changes, default=0.0)
    if not (quality > 0.0 and change < LARGEST_CHANGE):
        raise MeshError(
            f"at t = {fluid.time:.6g} the transfer to a new mesh changes the velocity by {change:.2g} "
            f"(quality of the worst cell {quality:.2g}): use a smaller numerics.mesh_size"
        )
    cells = int(topology.index_map(topology.dim).size_global)
    return carried, {"time": fluid.time, "cells": cells, "new_quality": quality, "change": change}


def _states(states: Sequence[Floats], old: Fluid, new: Fluid) -> Floats:
    """States (n, local unknowns) of a fluid at the nodes of a new one."""
    carried = np.zeros((len(states), len(new.state.x.array)))
    for (space, rows), (new_space, new_rows) in zip(old.space.parts, new.space.parts, strict=True):
        parts = [state[rows] for state in states]
        carried[:, new_rows] = transferred(parts, space, new_space, REACH)
    return carried


def _places(before: Coupling, new: Fluid) -> list[Floats]:
    """Positions of the new mesh's nodes at the times of positions of the old one's."""
    mesh, nodes = before.fluid.domain.mesh, new.domain.mesh.geometry.x
    transfer, way = Transfer(mesh, nodes, REACH), geometry_function(mesh)
    places, rows = [], geometry_rows(way)
    for old_places in before.places:
        moved = mesh.geometry.x - old_places
        way.x.array[:] = moved[rows, : new.space.gdim].ravel()
        places.append(nodes - spatial(transfer.values(way)))
    return places


class Projection(Owner):
    """Nearest discretely divergence-free velocities on a moving mesh. Every method is collective.

    With a multiplier p and prescribed values kept, (v - v*, w) - (p, div w) = 0, (q, div v) = 0 for
    all w, q; walls contribute as in continuity. GMRES reuses the first factorisation.
    """

    def __init__(self, fluid: Fluid):
        super().__init__(fluid.domain.comm)
        self.fluid, self._correction = fluid, dolfinx.fem.Function(fluid.space.mixed)
        mixed, where, dx = fluid.space.mixed, fluid.reference_map, fluid.quadrature()
        (u, p), (w, q) = ufl.TrialFunctions(mixed), ufl.TestFunctions(mixed)
        change, v = (ufl.split(function)[0] for function in (self._correction, fluid.state))
        left = (inertia(u, w, where) + continuity(w, p, where) + continuity(u, q, where)) * dx
        right = -continuity(v, q, where) * dx
        if fluid.walls is not None:
            left += fluid.walls.through(w, p, own=False) + fluid.walls.through(u, q, own=False)
            right -= fluid.walls.through(v, q)
        self._left, self._right = compat.form(left), compat.form(right)
        self._norms = [compat.form(inertia(field, field, where) * dx) for field in (change, v)]
        self._matrix = self.holding(petsc.create_matrix(self._left))
        self._vector = self.holding(compat.vector_of(self._right))
        self._view = self.holding(compat.vec_view(self._correction))
        self._solver = self.holding(fluid.another_solver(self._matrix))

    def apply(self) -> float:
        """Project the velocity of the fluid's state; returns the relative change in L2. Raises ConvergenceError.

        Prescribed values are kept and, in a closed domain, need zero net flux.
        """
        conditions, vector = self.fluid.constraints.dirichlet, self._vector
        compat.matrix_of(self._left, conditions, self._matrix)
        compat.vector_of(self._right, vector)
        # Zero change of prescribed velocities, zero pinned multiplier.
        compat.set_zero(vector, conditions)
        self._solver.solve(vector, self._view, rtol=1e-12)
        self._correction.x.scatter_forward()
        change, whole = (compat.integral(form, self.fluid.domain.comm) for form in self._norms)
        velocities = self.fluid.space.velocity_map
        self.fluid.state.x.array[velocities] += self._correction.x.array[velocities]
        return float(np.sqrt(change / whole)) if whole else 0.0
