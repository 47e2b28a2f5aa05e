"""Force, torque and traction of the fluid on a boundary, without hydrostatic pressure.

The momentum residual tested with a rigid motion of the surface is minus the power of the traction,
and converges at twice the rate of integrating sigma n (n into the fluid), the cross-check.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import dolfinx
import numpy as np
import ufl
from petsc4py import PETSc

from .. import compat
from ..arrays import Floats, cross, quarter_turned, spatial
from ..body.state import turned
from ..fluid import Fluid
from ..forms import surface_traction, surface_vector
from ..geometry.plane.closest import Closing
from ..meshes import SYMMETRY
from ..results.loads import ForceAndTorque
from ..symmetric import solve_symmetric

ACROSS = 1  # component normal to a plane of symmetry
# Force and torque of a whole body relative to half of it, cut at constant y: odd components cancel.
WITH_MIRROR_IMAGE = np.array([2.0, 0.0, 2.0, 0.0, 2.0, 0.0])


def shares_of_the_whole(fluid: Fluid) -> np.ndarray:
    """Force and torque (3,) or (6,) of a whole body relative to those computed on its meshed part."""
    if fluid.domain.halved:
        return WITH_MIRROR_IMAGE
    if fluid.model.mirrored:
        return 0.5 * WITH_MIRROR_IMAGE
    return np.ones(3 * fluid.domain.gdim - 3)


def rigid_motion(
    fluid: Fluid, boundary: str, about: Sequence[float] | Floats, motion: Floats
) -> Floats:
    """Velocity and spin (3 or 6,) of a boundary about a point, as (local unknowns,), zero elsewhere."""
    space, gdim = fluid.space, fluid.space.gdim
    blocks = compat.nodes_on(space.velocity, fluid.domain.facets_of(boundary))
    arms = fluid.constraints.points[blocks, :gdim] - np.asarray(about, dtype=float)
    values = np.zeros_like(fluid.state.x.array)
    values[space.unknowns_at_nodes[blocks]] = motion[:gdim] + turned(motion[gdim:], arms)
    return values


@dataclass(frozen=True)
class Resultant(ForceAndTorque):
    """Force and torque (6,) on the whole body about the point of its probe, in scene units."""

    load: Floats


class EnclosedPressure:
    """Pressure below a resting grain, between the boundaries `names` on two closing lines. Collective.

    Left of the first and right of the last contact it is that at the closing line; in between it
    varies in equal steps, since all contacts leak alike.
    """

    def __init__(self, fluid: Fluid, closing: Closing, names: tuple[str, str]):
        self._closing, self._comm = closing, fluid.domain.comm
        _, pressure = ufl.split(fluid.state)
        self._means = [
            compat.form(pressure / closing.width * fluid.domain.measure(name)) for name in names
        ]

    def load(self, about: Floats) -> tuple[Floats, Floats]:
        low, high = self._ends()
        contacts = self._closing.contacts
        places = np.vstack([self._closing.left.end, contacts, self._closing.right.end])
        return load_of(places - about[:2], np.linspace(low, high, len(contacts) + 1))

    def unknown(self, about: Floats) -> tuple[Floats, Floats]:
        """Change of force and torque (3,) if the pressure between contacts equals that on either side."""
        low, high = self._ends()
        contacts = self._closing.contacts
        force, torque = load_of(
            contacts - about[:2], np.full(len(contacts) - 1, 0.5 * (high - low))
        )
        return np.abs(force), np.abs(torque)

    def _ends(self) -> tuple[float, ...]:
        return tuple(compat.integral(mean, self._comm) for mean in self._means)


def load_of(arms: Floats, pressures: Floats) -> tuple[Floats, Floats]:
    """Force and torque (3,) about the origin of pressures (k,) between counter-clockwise outline points (k + 1, 2).

    A uniform pressure acts on a piece as on its chord, with the torque p/2 times the difference of
    the squared distances of its ends.
    """
    force = (pressures[:, None] * quarter_turned(np.diff(arms, axis=0))).sum(axis=0)
    torque = 0.5 * float(pressures @ np.diff((arms**2).sum(axis=1)))
    return spatial(force), np.array([0.0, 0.0, torque])


class TractionProbe:
    """Traction of a fluid on one of its boundaries. Every method is collective.

    Args:
        boundary: where it meets another one, the residual force includes the end nodes' fraction of
            that traction.
        about: reference point (gdim,) of torques; kept as `about` (3,), which may be set.
        enclosed: pressure that resultants include where no flow reaches.
    """

    def __init__(
        self,
        fluid: Fluid,
        boundary: str,
        about: Sequence[float] | Floats,
        enclosed: EnclosedPressure | None = None,
    ):
        self.fluid, self.boundary, self.enclosed = fluid, boundary, enclosed
        self.about = spatial(about)
        self._normal = -ufl.FacetNormal(fluid.domain.mesh)  # into the fluid
        space = fluid.space.velocity
        owned = space.dofmap.index_map.size_local
        blocks = compat.nodes_on(space, fluid.domain.facets_of(boundary))
        self._blocks = blocks[blocks < owned]
        self._unknowns = fluid.space.unknowns_at_nodes[self._blocks]
        w, q = ufl.TestFunctions(fluid.space.mixed)
        self._form: Any = None  # of the residual where the flow's own is not used
        if boundary in fluid.constraints.rubbing:
            # The flow's residual vanishes at the free boundary velocity.
            self._form = compat.form(-fluid.walls.power(fluid.state, w, boundary))
        elif fluid.model.unsteady:
            cells = np.isin(compat.cell_dofs(space), blocks).any(axis=1)
            near = fluid.quadrature(np.flatnonzero(cells).astype(np.int32))
            self._form = compat.form(fluid.residual_form(w, q, near))

    def resultant(self) -> Resultant:
        return self._sum(self._nodal_forces(), self.enclosed)

    def resultant_of(self, residual: np.ndarray) -> Resultant:
        """Force and torque of a fluid residual, or its change, (owned unknowns,), with flow all around."""
        return self._sum(-residual[self._unknowns], self.enclosed)

    def surface_resultant(self, viscous: bool = False) -> Resultant:
        """Integral of the stress at the boundary; `viscous`: of viscous stress or wall friction alone."""
        fluid, w = self.fluid, ufl.TestFunction(self.fluid.space.velocity)
        (v, p), ds = ufl.split(fluid.state), fluid.domain.measure(self.boundary)
        if self.boundary in fluid.constraints.rubbing:
            power = fluid.walls.power(fluid.state, w, self.boundary, held=False)
        else:
            traction = surface_traction(v, p, self._normal, fluid.viscosity, fluid.reference_map)
            power = ufl.inner(traction, w) * ds
        if viscous:
            power += p * ufl.inner(surface_vector(self._normal, fluid.reference_map), w) * ds
        forces = compat.owned_entries(compat.form(power)).reshape(-1, fluid.space.gdim)
        return self._sum(forces[self._blocks], None if viscous else self.enclosed)

    def field(self) -> Any:
        """Traction as a velocity-space function t, (t, w) over the boundary being the nodal forces; zero elsewhere."""
        space, domain, gdim = self.fluid.space.velocity, self.fluid.domain, self.fluid.space.gdim
        traction = dolfinx.fem.Function(space, name="traction")
        start, end = space.dofmap.index_map.local_range
        forces, across = np.zeros((end - start, gdim)), np.empty(0, dtype=PETSc.IntType)
        forces[self._blocks] = self._nodal_forces()
        if domain.halved:
            across = compat.nodes_on(space, domain.facets_of(SYMMETRY))
            across = np.intersect1d(self._blocks, across).astype(PETSc.IntType)
            forces[across, ACROSS] = 0.0
        mass = compat.matrix_of(self._mass_form)
        # Rows off the boundary are empty as well.
        mass.zeroRowsColumns(gdim * (start + across) + ACROSS, diag=0.0)
        right = mass.createVecRight()
        right.setArray(forces)
        solve_symmetric(mass, right, traction)
        return traction

    def vectors(self) -> tuple[np.ndarray, np.ndarray]:
        nodal = self.field().x.array.reshape(-1, self.fluid.space.gdim)[self._blocks]
        gathered = self.fluid.domain.comm.allgather((self._places(), nodal))
        points, tractions = (np.concatenate(parts) for parts in zip(*gathered, strict=True))
        return points, tractions

    def _nodal_forces(self) -> np.ndarray:
        fluid, form = self.fluid, self._form
        residual = fluid.residual() if form is None else fluid.assembled(form)
        return -residual[self._unknowns]

    def _sum(self, forces: np.ndarray, enclosed: EnclosedPressure | None) -> Resultant:
        """Resultant on the whole body of nodal forces (n, gdim) on the meshed part, at own nodes."""
        forces = spatial(forces)
        arms = spatial(self._places()) - self.about
        mine = np.array([forces.sum(axis=0), cross(arms, forces).sum(axis=0)])
        load = self.fluid.domain.comm.allreduce(mine)
        if self.fluid.space.gdim == 3:
            # No zeros below zero.
            load = load * shares_of_the_whole(self.fluid).reshape(2, 3) + 0.0
        if enclosed is not None:
            load = load + enclosed.load(self.about)
        return Resultant(load.ravel())

    def _places(self) -> np.ndarray:
        gdim = self.fluid.space.gdim
        if self.fluid.model.reference_map is None:
            return self.fluid.constraints.points[self._blocks, :gdim]
        place = dolfinx.fem.Function(self.fluid.space.velocity)
        compat.interpolate(place, self.fluid.place())
        return place.x.array.reshape(-1, gdim)[self._blocks]

    @cached_property
    def _mass_form(self) -> Any:
        space = self.fluid.space.velocity
        t, w = ufl.TrialFunction(space), ufl.TestFunction(space)
        normal = surface_vector(self._normal, self.fluid.reference_map)
        ds = self.fluid.domain.measure(self.boundary)
        return compat.form(ufl.sqrt(ufl.inner(normal, normal)) * ufl.inner(t, w) * ds)
