"""Boundary conditions of the flow: as data, and as time-dependent Dirichlet conditions in its mixed system."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import dolfinx
import numpy as np
import ufl

from .. import compat
from ..mesh.domain import Domain
from ..parallel import largest
from .space import TaylorHood

# Weights of the coordinates whose sum is least at the lower corner of the left end: no other node is as near.
TO_CORNER = (1.0, 0.1, 0.01)

Velocity = Callable[[np.ndarray, float], np.ndarray]


@dataclass(frozen=True)
class Prescribed:
    """Prescribed velocity (gdim, n), a function of x (3, n) and t."""

    boundary: str
    velocity: Velocity


@dataclass(frozen=True)
class Slip:
    """Impermeable, shear-free boundary normal to a coordinate axis."""

    boundary: str
    axis: int


@dataclass(frozen=True)
class Friction:
    """Impermeable boundary with a law of the wall.

    distance: of the wall beyond the boundary. drag: friction over velocity, of speed, shear velocity from
    k, 1/Re and distance (UFL). axis: normal of a plane boundary at that distance; None: any boundary at the wall
    itself. moves: as a rigid body (`friction.WallLoad.carry`).
    """

    boundary: str
    distance: float
    drag: Callable[[Any, Any, Any, Any], Any]
    axis: int | None = None
    moves: bool = False


@dataclass(frozen=True)
class Open:
    """Outflow boundary, -p n + nu dv/dn = 0.

    velocity: of backflow, as in `Prescribed`; None: that of the flow.
    """

    boundary: str
    velocity: Velocity | None = None


@dataclass(frozen=True)
class Entering:
    """End below a free surface with prescribed discharge (see `Entry`).

    velocity: along the normal `axis`, (n,), a function of undeformed positions (3, n) and t. level:
    length of the zone in which the surface is levelled. supercritical: whether the flow is, so that the
    still level is imposed. wave, elevation: velocity (gdim, n) of the base flow with a wave, and elevation
    (n,) of the wave, functions of x (3, n) and t; None: no wave.
    """

    boundary: str
    axis: int
    velocity: Callable[[np.ndarray, float], np.ndarray]
    level: float
    supercritical: bool = False
    wave: Velocity | None = None
    elevation: Callable[[np.ndarray, float], np.ndarray] | None = None


@dataclass(frozen=True)
class Carried:
    """Surface of a moving body, whose velocity `Constraints.carry` sets."""

    boundary: str


@dataclass(frozen=True)
class Sponge:
    """Zone from `start` to `end` (x) in which the flow relaxes to the base flow.

    rate: at the end, growing quadratically from zero. base_flow: velocity (gdim, n) of x (3, n) and t.
    """

    start: float
    end: float
    rate: float
    base_flow: Velocity


@dataclass(frozen=True)
class FreeSurface:
    """Top boundary that moves with the fluid, a graph over the plane.

    gravity: acceleration (gdim,), whose hydrostatic pressure acts where the surface departs from the still
    level. origin: position (gdim,) of the still level, at which the flow's pressure equals that above the
    surface. pinned: no-slip boundaries at which the elevation is fixed.
    """

    boundary: str
    gravity: tuple[float, ...]
    origin: tuple[float, ...]
    pinned: tuple[str, ...] = ()
    sponge: Sponge | None = None


Condition = Prescribed | Slip | Friction | Open | Entering | Carried | FreeSurface


def no_slip(boundary: str) -> Prescribed:
    """Wall at rest."""
    return Prescribed(boundary, lambda x, t: np.zeros_like(x))


class Constraints:
    """Time-dependent Dirichlet conditions of a flow.

    Where boundaries meet, the condition listed last applies. With `level`, an otherwise undetermined
    pressure is zero at one node.
    """

    def __init__(
        self, domain: Domain, space: TaylorHood, conditions: Sequence[Condition], level: bool = True
    ):
        self.space, self.domain, self.points = space, domain, space.velocity_points()
        self._values = dolfinx.fem.Function(space.velocity)
        self.prescribe(conditions)
        self.open = tuple(c.boundary for c in conditions if isinstance(c, Open))
        self.backflow = self._values if self._velocities.keys() & set(self.open) else None
        self.surface = next((c for c in conditions if isinstance(c, FreeSurface)), None)
        self.closed = not self.open and self.surface is None
        self.friction = tuple(c for c in conditions if isinstance(c, Friction))
        self.rubbing = tuple(c.boundary for c in self.friction)
        carried = [c.boundary for c in conditions if isinstance(c, Carried)]
        prescribed = [c.boundary for c in conditions if isinstance(c, Prescribed)]
        self._nodes = {
            name: compat.nodes_on(space.velocity, domain.facets_of(name))
            for name in (*prescribed, *carried, *self.open)
        }
        self.entries = tuple(
            Entry(domain, space, c, prescribed) for c in conditions if isinstance(c, Entering)
        )
        self.crossings = (*self.open, *(entry.condition.boundary for entry in self.entries))
        self.dirichlet = self._velocity_conditions([*prescribed, *carried], conditions)
        if level and self.closed:
            self.dirichlet.append(self._pressure_pin())

    @property
    def influx(self) -> float:
        return sum(entry.influx for entry in self.entries)

    def update(self, t: float) -> None:
        gdim = self.space.gdim
        values = self._values.x.array.reshape(-1, gdim)
        for boundary, velocity in self._velocities.items():
            blocks = self._nodes[boundary]
            if len(blocks):
                values[blocks] = np.asarray(velocity(self.points[blocks].T, t))[:gdim].T
        for entry in self.entries:
            entry.update(t, self.points)

    def prescribe(self, conditions: Sequence[Condition]) -> None:
        self._velocities = {
            c.boundary: c.velocity
            for c in conditions
            if isinstance(c, Prescribed | Open) and c.velocity is not None
        }

    def carry(self, boundary: str, velocity: Callable[[np.ndarray], np.ndarray]) -> None:
        """Set the velocity of a carried boundary, a function of node positions (n, gdim)."""
        gdim, blocks = self.space.gdim, self._nodes[boundary]
        self._values.x.array.reshape(-1, gdim)[blocks] = velocity(self.points[blocks, :gdim])

    def _velocity_conditions(
        self, prescribed: list[str], conditions: Sequence[Condition]
    ) -> list[Any]:
        whole, of_boundary = self.space.mixed.sub(0), self.domain.facets_of
        slip = [c for c in conditions if isinstance(c, Slip | Friction) and c.axis is not None]
        components: list[tuple[Any, Any]] = []
        if slip:
            zero = dolfinx.fem.Function(self.space.component())
            components = [(condition, zero) for condition in slip]
        components += [(entry.condition, entry.values) for entry in self.entries]
        held = [
            _on_facets(values, whole.sub(condition.axis), of_boundary(condition.boundary))
            for condition, values in components
        ]
        if prescribed:
            facets = np.unique(np.concatenate([of_boundary(name) for name in prescribed]))
            held.append(_on_facets(self._values, whole, facets))
        return held

    def _pressure_pin(self) -> Any:
        """Zero at a corner of the domain, the same on any number of ranks.

        Prescribed velocities that do not balance leave a source there.
        """
        space, comm = self.space.pressure, self.domain.comm
        away = space.tabulate_dof_coordinates() @ TO_CORNER
        low, high = -largest(comm, -away, -np.inf), largest(comm, away, -np.inf)
        # A node's positions on several ranks differ by round-off.
        corner = np.flatnonzero(away <= low + 1e-12 * (high - low)).astype(np.int32)
        mixed = self.space.pressure_map[corner].astype(np.int32)
        zero = dolfinx.fem.Function(space)
        return dolfinx.fem.dirichletbc(zero, [mixed, corner], self.space.mixed.sub(1))


def _on_facets(values: Any, part: Any, facets: np.ndarray) -> Any:
    nodes = compat.nodes_on((part, values.function_space), facets)
    return dolfinx.fem.dirichletbc(values, nodes, part)


class Entry:
    """Prescribed discharge through an end, with the velocity profile stretched with the depth. Collective.

    Attributes:
        space, values: one velocity component, with values on the boundary.
        influx: volume flux through the mesh at the last `update`.
        wave: velocity of the base flow with the condition's wave; None: no wave.
    """

    def __init__(
        self,
        domain: Domain,
        space: TaylorHood,
        condition: Entering,
        walls: Sequence[str],
    ):
        boundary, axis, mesh = condition.boundary, condition.axis, domain.mesh
        self.condition, self.space = condition, space.component()
        self.values, self.influx = dolfinx.fem.Function(self.space), 0.0
        self.wave: Any = None if condition.wave is None else dolfinx.fem.Function(space.velocity)
        still = [compat.nodes_on(self.space, domain.facets_of(name)) for name in walls]
        on = compat.nodes_on(self.space, domain.facets_of(boundary))
        self._nodes = np.setdiff1d(on, np.concatenate([np.empty(0, dtype=np.int32), *still]))
        self._places = self.space.tabulate_dof_coordinates()[self._nodes].T.copy()
        self._own = self._nodes[self._nodes < self.space.dofmap.index_map.size_local]
        self._comm = domain.comm
        inwards = -ufl.FacetNormal(mesh)[axis]
        measure = space.boundary_quadrature(domain.facets)(domain.names[boundary])
        self._end = largest(domain.comm, self._places[axis], -np.inf)
        self._form = compat.form(ufl.inner(inwards, ufl.TestFunction(self.space)) * measure)
        self._made = self._areas()

    def update(self, t: float, points: np.ndarray) -> None:
        """Set the velocities at a time, with velocity nodes at `points` (n, 3)."""
        if self.condition.wave is not None:
            wave = self.condition.wave(points.T, t)
            self.wave.x.array.reshape(len(points), -1)[:] = wave.T
        velocities = np.asarray(self.condition.velocity(self._places, t))
        now = self._areas()
        mine = velocities[: len(self._own)]
        sums = np.array([abs(mine) @ self._made, abs(mine) @ now, mine @ now])
        as_made, stretched, through = self._comm.allreduce(sums)
        factor = float(as_made / stretched) if stretched else 1.0
        self.values.x.array[self._nodes] = factor * velocities
        self.influx = factor * float(through)

    def zone(self, place: Any) -> Any:
        """Length of the level zone, quadratically decreasing to zero along it, in UFL."""
        length = self.condition.level
        rest = 1 - abs(place[self.condition.axis] - self._end) / length
        return length * ufl.conditional(ufl.gt(rest, 0), rest**2, 0)

    def _areas(self) -> np.ndarray:
        return compat.owned_entries(self._form)[self._own]
