"""Force, torque and traction of the fluid on a boundary.

The force on a body is the integral of sigma n over its surface with n out of the body, into the fluid.
The consistent (residual) method reads it off the assembled momentum residual: tested with the extension
of a rigid motion from the surface, the residual is minus the power of the traction in that motion. It
converges at twice the rate of integrating sigma n, which is kept as a cross-check.

Hydrostatic pressure is not in the flow's pressure (see docs/explanation/flow.md): buoyancy is a force of its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import dolfinx
import numpy as np
import ufl
from petsc4py import PETSc

from .. import compat
from ..arrays import Floats, cross, spatial
from ..body.state import turned
from ..compat import petsc
from ..fluid import Fluid
from ..fluid.space import boundary_blocks
from ..forms import surface_traction, surface_vector
from ..mesh.domain import Domain
from ..meshes import SYMMETRY
from ..symmetric import solve_symmetric
from .enclosed import EnclosedPressure

ACROSS = 1  # the component across a plane of symmetry
# Force and torque of a whole body over those of half of it, cut in a plane of constant y: what is odd cancels.
WITH_MIRROR_IMAGE = np.array([2.0, 0.0, 2.0, 0.0, 2.0, 0.0])


def shares_of_the_whole(domain: Domain) -> np.ndarray:
    """(k,) force and torque, k = 3 or 6, of a whole body over those of what is meshed of it. Not collective."""
    if domain.halved:
        return WITH_MIRROR_IMAGE
    return np.ones(3 if domain.gdim == 2 else 6)


def rigid_motion(
    fluid: Fluid, boundary: str, about: Sequence[float] | Floats, motion: Floats
) -> Floats:
    """(local unknowns,) a velocity and a spin (3 or 6,) of a boundary about a point, zero elsewhere. Not collective."""
    space, gdim = fluid.space, fluid.space.gdim
    blocks = boundary_blocks(space.velocity, fluid.domain.facets_of(boundary))
    arms = fluid.constraints.points[blocks, :gdim] - np.asarray(about, dtype=float)
    values = np.zeros_like(fluid.state.x.array)
    values[space.unknowns_at_nodes[blocks]] = motion[:gdim] + turned(motion[gdim:], arms)
    return values


@dataclass(frozen=True)
class Resultant:
    """Force (3,) and torque (3,) about a point (3,), in scene units; in 2D the torque is along the third axis.

    Where half of a symmetric domain is meshed they are those of the whole body, cut by the plane of symmetry.
    """

    force: np.ndarray
    torque: np.ndarray
    about: np.ndarray


class TractionProbe:
    """Reads the traction of one fluid on one of its boundaries. Every method is collective.

    Args:
        fluid: the solved flow.
        boundary: name of the boundary, such as "body". Where it meets another one (a wall and the inflow),
            the residual force includes the end nodes' fraction of the traction of the other boundary.
        about: point that torques refer to, (gdim,).
        enclosed: of a body part of which no flow reaches: the pressure there, which is in the resultants.
    """

    def __init__(
        self,
        fluid: Fluid,
        boundary: str,
        about: Sequence[float],
        enclosed: EnclosedPressure | None = None,
    ):
        self.fluid, self.boundary, self.enclosed = fluid, boundary, enclosed
        self.refer_to(about)
        space = fluid.space.velocity
        owned = space.dofmap.index_map.size_local
        blocks = boundary_blocks(space, fluid.domain.facets_of(boundary))
        self._blocks = blocks[blocks < owned]
        self._surface_form: Any = None
        self._mass_form: Any = None
        self._near_form = self._made_near(blocks)

    def refer_to(self, about: Sequence[float]) -> None:
        """Take torques about another point (gdim,), such as the centre of a body that has moved."""
        self.about = spatial(np.asarray(about, dtype=float)[None])[0]

    def resultant(self) -> Resultant:
        """Force and torque by the residual method."""
        return self._with_enclosed(self._sum(self._nodal_forces()))

    def resultant_of(self, residual: np.ndarray) -> Resultant:
        """Force and torque that a residual of the fluid (owned unknowns,), or a change of it, stands for."""
        return self._sum(-residual[self._unknowns()])

    def surface_resultant(self) -> Resultant:
        """Force and torque by integrating sigma n over the boundary, or a law of the wall: the cross-check."""
        space = self.fluid.space.velocity
        if self._surface_form is None and self.boundary in self.fluid.constraints.rubbing:
            w = ufl.TestFunction(space)
            self._surface_form = compat.form(
                self.fluid.walls.power(self.fluid.state, w, self.boundary, held=False)
            )
        elif self._surface_form is None:
            v, p = ufl.split(self.fluid.state)
            w = ufl.TestFunction(space)
            n = -ufl.FacetNormal(self.fluid.domain.mesh)
            traction = surface_traction(v, p, n, self.fluid.viscosity, self.fluid.reference_map)
            ds = self.fluid.domain.measure(self.boundary)
            self._surface_form = compat.form(ufl.inner(traction, w) * ds)
        return self._with_enclosed(self._integrated(self._surface_form))

    def viscous_resultant(self) -> Resultant:
        """Part of `surface_resultant` due to viscous stress, or to the friction of a law of the wall."""
        _, p = ufl.split(self.fluid.state)
        w, n = ufl.TestFunction(self.fluid.space.velocity), -ufl.FacetNormal(self.fluid.domain.mesh)
        pressure = -p * surface_vector(n, self.fluid.reference_map)
        ds = self.fluid.domain.measure(self.boundary)
        part = self._with_enclosed(self._integrated(compat.form(ufl.inner(pressure, w) * ds)))
        whole = self.surface_resultant()
        return Resultant(whole.force - part.force, whole.torque - part.torque, self.about)

    def _integrated(self, form: Any) -> Resultant:
        """Force and torque of the linear form of a traction."""
        vector = petsc.assemble_vector(form)
        vector.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
        forces = vector.array_r.reshape(-1, self.fluid.space.gdim)[self._blocks].copy()
        vector.destroy()
        return self._sum(forces)

    def _with_enclosed(self, exposed: Resultant) -> Resultant:
        if self.enclosed is None:
            return exposed
        force, torque = self.enclosed.load(self.about)
        return Resultant(exposed.force + force, exposed.torque + torque, exposed.about)

    def field(self) -> Any:
        """The traction as a velocity-space function, zero off the boundary; its integral is the residual force.

        The function t with (t, w) over the boundary equal to the nodal forces for every w. Where half of a symmetric
        domain is meshed, t and w have no component across the plane of symmetry in that plane, as the velocity.
        """
        space = self.fluid.space.velocity
        traction = dolfinx.fem.Function(space, name="traction")
        mass = self._boundary_mass()
        right = mass.createVecRight()
        values = np.zeros(right.getLocalSize())
        values.reshape(-1, self.fluid.space.gdim)[self._blocks] = self._nodal_forces()
        right.setArray(values)
        across = self._across_symmetry()
        mass.zeroRowsColumns(across, diag=0.0)  # rows off the boundary are also empty
        right.setValues(across, np.zeros(len(across)))
        right.assemble()
        solve_symmetric(mass, right, traction)
        return traction

    def vectors(self) -> tuple[np.ndarray, np.ndarray]:
        """Points (n, gdim) of the boundary and the traction there (n, gdim), those of all ranks on each of them."""
        gdim = self.fluid.space.gdim
        traction = self.field()
        nodal = traction.x.array.reshape(-1, gdim)[self._blocks]
        gathered = self.fluid.domain.comm.allgather((self._places(), nodal))
        points, tractions = (np.concatenate(parts) for parts in zip(*gathered, strict=True))
        return points, tractions

    def _across_symmetry(self) -> np.ndarray:
        """Global numbers, in the velocity's space, of owned components across a plane of symmetry in it."""
        domain, space = self.fluid.domain, self.fluid.space.velocity
        if not domain.halved:
            return np.empty(0, dtype=PETSc.IntType)
        nodes = np.intersect1d(self._blocks, boundary_blocks(space, domain.facets_of(SYMMETRY)))
        nodes = nodes + space.dofmap.index_map.local_range[0]
        return (self.fluid.space.gdim * nodes + ACROSS).astype(PETSc.IntType)

    def _nodal_forces(self) -> np.ndarray:
        """(owned nodes on the boundary, gdim): minus the momentum residual there."""
        return -self._residual()[self._unknowns()]

    def _residual(self) -> np.ndarray:
        """(owned unknowns,) residual, right at the boundary's nodes."""
        return (
            self.fluid.residual()
            if self._near_form is None
            else self.fluid.assembled(self._near_form)
        )

    def _made_near(self, blocks: np.ndarray) -> Any:
        """The compiled form of the residual at the nodes; None: the residual of all cells is used.

        An unsteady flow integrates it at every step, over the cells at the nodes only. Along a boundary with a law of
        the wall the velocity is free and the flow's residual vanishes: the term of the law alone is the wall's force.
        """
        fluid, (w, q) = self.fluid, ufl.TestFunctions(self.fluid.space.mixed)
        if self.boundary in fluid.constraints.rubbing:
            return compat.form(-fluid.walls.power(fluid.state, w, self.boundary))
        if not fluid.model.unsteady:
            return None
        return compat.form(fluid.residual_form(w, q, fluid.space.cells_at(blocks)))

    def _unknowns(self) -> np.ndarray:
        """(owned nodes on the boundary, gdim): numbers of their velocities in the fluid's state."""
        return self.fluid.space.unknowns_at_nodes[self._blocks]

    def _sum(self, forces: np.ndarray) -> Resultant:
        forces = spatial(forces)
        arms = spatial(self._places()) - self.about
        mine = np.array([forces.sum(axis=0), cross(arms, forces).sum(axis=0)])
        force, torque = self.fluid.domain.comm.allreduce(mine)
        if self.fluid.domain.halved:
            force, torque = (
                np.array([force, torque]) * WITH_MIRROR_IMAGE.reshape(2, 3) + 0.0
            )  # no zeros below zero
        return Resultant(force, torque, self.about)

    def _places(self) -> np.ndarray:
        """Coordinates of the boundary's owned nodes, (n, gdim)."""
        gdim = self.fluid.space.gdim
        if self.fluid.model.reference_map is None:
            return self.fluid.constraints.points[self._blocks, :gdim]
        place = dolfinx.fem.Function(self.fluid.space.velocity)
        compat.interpolate(place, self.fluid.place())
        return place.x.array.reshape(-1, gdim)[self._blocks]

    def _boundary_mass(self) -> Any:
        if self._mass_form is None:
            space = self.fluid.space.velocity
            t, w = ufl.TrialFunction(space), ufl.TestFunction(space)
            n = ufl.FacetNormal(self.fluid.domain.mesh)
            normal = surface_vector(n, self.fluid.reference_map)
            scale = ufl.sqrt(ufl.inner(normal, normal))
            ds = self.fluid.domain.measure(self.boundary)
            self._mass_form = compat.form(scale * ufl.inner(t, w) * ds)
        mass = petsc.assemble_matrix(self._mass_form)
        mass.assemble()
        return mass
