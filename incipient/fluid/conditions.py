"""Boundary conditions of the flow, and their place in the mixed system."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import dolfinx
import numpy as np
import ufl
from mpi4py import MPI

from .. import compat
from ..mesh.domain import Domain
from .entry import Entry
from .space import TaylorHood, boundary_blocks

Velocity = Callable[[np.ndarray, float], np.ndarray]


@dataclass(frozen=True)
class Prescribed:
    """Velocity given on a boundary: a function of x (3, n) and t that returns (gdim, n)."""

    boundary: str
    velocity: Velocity


@dataclass(frozen=True)
class Seeping(Prescribed):
    """Velocity given on a boundary below a free surface, through which fluid seeps in or out."""


@dataclass(frozen=True)
class Slip:
    """No flow through a boundary whose normal is a coordinate axis, and no shear on it."""

    boundary: str
    axis: int


@dataclass(frozen=True)
class Friction:
    """A boundary along which a flow is resisted by a wall a distance beyond it, by a law; nothing crosses it.

    distance: of the wall
    drag:     friction over the velocity: a function of the speed, of the shear velocity that k there
              stands for, of 1/Re and of the distance (UFL)
    axis:     that of the normal of a plane boundary, which the mesh really has at that distance from the wall; None: a
              boundary of any shape, at the wall itself, where the distance is one of the law's alone
    moves:    whether the wall, of any shape, moves as a rigid body: `friction.WallLoad.carry` sets its velocity
    """

    boundary: str
    distance: float
    drag: Callable[[Any, Any, Any, Any], Any]
    axis: int | None = None
    moves: bool = False


@dataclass(frozen=True)
class Open:
    """A boundary through which fluid leaves freely: -p n + nu dv/dn = 0."""

    boundary: str


@dataclass(frozen=True)
class Wave:
    """A wave that comes in at an end with a stream.

    velocity:  of both, a function of x (3, n), places as they are, and t that returns (gdim, n)
    elevation: a function of x (3, n), of which only places along the level matter, and t that returns (n,)
    """

    velocity: Velocity
    elevation: Callable[[np.ndarray, float], np.ndarray]


@dataclass(frozen=True)
class Entering:
    """An end below a free surface through which fluid enters, or leaves, at a given rate (see `entry.Entry`).

    axis:     that of its normal
    velocity: along the axis; a function of x (3, n), places as the mesh was made, and t that returns (n,)
    level:    length of the zone next to the end in which the surface is made level
    given:    whether the level there is the still one: for streams faster than long waves
    wave:     what of `velocity` is a wave, which also has a velocity across and an elevation; None: there is none
    """

    boundary: str
    axis: int
    velocity: Callable[[np.ndarray, float], np.ndarray]
    level: float
    given: bool = False
    wave: Wave | None = None


@dataclass(frozen=True)
class Carried:
    """The surface of a moving body; `Constraints.carry` sets its velocity in every coupling iteration."""

    boundary: str


@dataclass(frozen=True)
class Sponge:
    """A zone at an end of a channel in which the flow is relaxed to a stream, so that other waves die out there.

    start:  x at which it begins
    end:    x of the end of the channel
    rate:   at the end; it rises with the square of the distance from the start
    stream: a function of x (3, n) and t, which is zero here, that returns (gdim, n); None: stream and wave that come in
    """

    start: float
    end: float
    rate: float
    stream: Velocity | None


@dataclass(frozen=True)
class FreeSurface:
    """A boundary on top that moves with the fluid and is a graph over the plane; velocities there are free.

    gravity:  acceleration (gdim,); its hydrostatic pressure acts on the surface where this is above the still level
    origin:   a place (gdim,) of the still level, at which the flow's pressure is that above the surface
    pressure: of what is above, over the fluid's density: a function of x (3, n) and t that returns (n,); None: zero
    tension:  surface tension over the fluid's density
    pinned:   names of the boundaries at which its elevation stays; the fluid sticks to them
    sponges:  zones at the ends of a channel in which waves die out
    """

    boundary: str
    gravity: tuple[float, ...]
    origin: tuple[float, ...]
    pressure: Callable[[np.ndarray, float], np.ndarray] | None = None
    tension: float = 0.0
    pinned: tuple[str, ...] = ()
    sponges: tuple[Sponge, ...] = ()


Condition = Prescribed | Slip | Friction | Open | Entering | Carried | FreeSurface


def no_slip(boundary: str) -> Prescribed:
    """A wall at rest."""
    return Prescribed(boundary, lambda x, t: np.zeros_like(x))


class Constraints:
    """The Dirichlet conditions of a flow, kept up to date with time.

    Where two boundaries meet, the condition named later holds: name walls after moving lids and the
    corners are watertight. With `level` the pressure is zero at one node where no boundary gives it a level.
    """

    def __init__(
        self, domain: Domain, space: TaylorHood, conditions: Sequence[Condition], level: bool = True
    ):
        self.space, self._domain = space, domain
        self.open = tuple(c.boundary for c in conditions if isinstance(c, Open))
        self.surface = next((c for c in conditions if isinstance(c, FreeSurface)), None)
        self._values = dolfinx.fem.Function(space.velocity)
        self.points = space.velocity_points()
        prescribed = [c for c in conditions if isinstance(c, Prescribed)]
        self.prescribe(conditions)
        self._slip = [c for c in conditions if isinstance(c, Slip | Friction) and c.axis is not None]
        self._friction = tuple(c for c in conditions if isinstance(c, Friction))
        carried = [c.boundary for c in conditions if isinstance(c, Carried)]
        self._carried = {name: boundary_blocks(space.velocity, domain.facets_of(name)) for name in carried}
        given = [c.boundary for c in prescribed]
        self.entries = tuple(
            Entry(domain, space, c, tuple(given)) for c in conditions if isinstance(c, Entering)
        )
        self._seepage = self._through([c.boundary for c in prescribed if isinstance(c, Seeping)])
        self.seeps, self.seepage = self._seepage is not None, 0.0
        self.dirichlet = self._velocity_conditions(domain, [*given, *carried])
        if level and self.closed:
            self.dirichlet.append(self._pressure_pin())

    @property
    def closed(self) -> bool:
        """Whether no boundary gives the pressure a level, so that it is known up to a constant only."""
        return not self.open and self.surface is None

    @property
    def rubbing(self) -> tuple[str, ...]:
        """Names of the boundaries along which the flow is resisted by a law of the wall."""
        return tuple(one.boundary for one in self._friction)

    @property
    def walls_are_level(self) -> bool:
        """Whether all boundaries along which the flow is resisted are planes across an axis, at a distance of walls."""
        return all(one.axis is not None for one in self._friction)

    @property
    def crossings(self) -> tuple[str, ...]:
        """Names of the ends across which the flow is not held: open ones, and those at which it is given along only."""
        return (*self.open, *(entry.boundary for entry in self.entries))

    @property
    def influx(self) -> float:
        """What enters per time through all entries and by seepage, at the last `update`."""
        return sum((entry.influx for entry in self.entries), self.seepage)

    def surface_load(self, rate: Any) -> Any:
        """The load of the free surface, by the rate of its elevation in a step (UFL); None without one. Collective."""
        if self.surface is None:
            return None
        from .surface import SurfaceLoad

        return SurfaceLoad(self._domain, self.space, self, rate)

    def walls(self, viscosity: tuple[Any, Any], shear_velocity: Any) -> Any:
        """The load of walls with a law of friction, see `friction.WallLoad`; None without. Collective."""
        if not self._friction:
            return None
        from .friction import WallLoad

        return WallLoad(self._domain, self.space, self._friction, viscosity, shear_velocity)

    def crossed(self) -> Any:
        """The measure of the boundary that fluid may cross: nothing crosses a free surface."""
        whole, names = self.space.boundary_quadrature(self._domain.facets), self._domain.names
        if self.surface is None:
            return whole
        return whole(tuple(tag for name, tag in names.items() if name != self.surface.boundary))

    def open_pressures(self, surface: FreeSurface | None = None) -> np.ndarray:
        """Local pressure nodes on the boundaries through which fluid leaves freely, and on a surface. Collective."""
        names = self.open if surface is None else (*self.open, surface.boundary)
        nodes = [boundary_blocks(self.space.pressure, self._domain.facets_of(name)) for name in names]
        return np.unique(np.concatenate([*nodes, np.empty(0, dtype=np.int32)])).astype(np.int32)

    def update(self, t: float) -> None:
        """Evaluate the prescribed velocities at time t. Collective."""
        gdim = self.space.gdim
        values = self._values.x.array.reshape(-1, gdim)
        for velocity, blocks in self._prescribed:
            if len(blocks):
                values[blocks] = np.asarray(velocity(self.points[blocks].T, t))[:gdim].T
        for entry in self.entries:
            entry.update(t)
        if self._seepage is not None:
            mine = float(np.real(dolfinx.fem.assemble_scalar(self._seepage)))
            self.seepage = float(self._domain.comm.allreduce(mine))

    def prescribe(self, conditions: Sequence[Condition]) -> None:
        """Take the prescribed velocities among conditions; they hold from the next `update`. Not collective."""
        self._prescribed = [
            (c.velocity, boundary_blocks(self.space.velocity, self._domain.facets_of(c.boundary)))
            for c in conditions
            if isinstance(c, Prescribed)
        ]

    def carry(self, boundary: str, velocity: Callable[[np.ndarray], np.ndarray]) -> None:
        """Give a carried boundary its velocity, a function of its nodes' places (n, gdim)."""
        gdim, blocks = self.space.gdim, self._carried[boundary]
        self._values.x.array.reshape(-1, gdim)[blocks] = velocity(self.points[blocks, :gdim])

    def carried_cells(self) -> np.ndarray:
        """Local cells that have a node on a carried boundary, in ascending order."""
        blocks = np.concatenate([*self._carried.values(), np.empty(0, dtype=np.int32)])
        return self.space.cells_at(blocks)

    def boundary_points_moved(self) -> None:
        """Read the nodes' places again after the mesh has moved."""
        self.points = self.space.velocity_points()

    def _through(self, names: list[str]) -> Any:
        """What the prescribed velocities bring in through boundaries, as a form; None: there are none."""
        if not names:
            return None
        measure = self.space.boundary_quadrature(self._domain.facets)
        inwards = -ufl.inner(self._values, ufl.FacetNormal(self.space.mixed.mesh))
        return compat.form(inwards * measure(tuple(self._domain.names[name] for name in names)))

    def _velocity_conditions(self, domain: Domain, prescribed: list[str]) -> list[Any]:
        whole = self.space.mixed.sub(0)
        conditions = []
        for slip in self._slip:
            component = compat.space(self.space.mixed.mesh, ("Lagrange", self.space.order))
            zero = dolfinx.fem.Function(component)
            facets = domain.facets_of(slip.boundary)
            conditions.append(_on_facets(zero, (whole.sub(slip.axis), component), facets))
        for entry in self.entries:
            facets = domain.facets_of(entry.boundary)
            conditions.append(_on_facets(entry.values, (whole.sub(entry.axis), entry.space), facets))
        if prescribed:
            facets = np.unique(np.concatenate([domain.facets_of(name) for name in prescribed]))
            conditions.append(_on_facets(self._values, (whole, self.space.velocity), facets))
        return conditions

    def _pressure_pin(self) -> Any:
        """One pressure unknown set to zero."""
        index_map = self.space.pressure.dofmap.index_map
        numbers = np.concatenate([np.arange(*index_map.local_range), index_map.ghosts])
        own = np.flatnonzero(numbers == _first_node(self.space.pressure)).astype(np.int32)
        zero = dolfinx.fem.Function(self.space.pressure)
        mixed = self.space.pressure_map[own].astype(np.int32)
        return dolfinx.fem.dirichletbc(zero, [mixed, own], self.space.mixed.sub(1))


def _first_node(space: Any) -> int:
    """Global number of the node that comes first by its coordinates, the same place on any number of ranks."""
    index_map = space.dofmap.index_map
    points = space.tabulate_dof_coordinates()
    comm = space.mesh.comm
    size = comm.allreduce(float(np.abs(points).max(initial=0.0)), op=MPI.MAX)
    # Rounded, so that round-off does not decide among nodes on a straight side.
    places = np.round(points[: index_map.size_local] / size, 9) + 0.0
    order = np.lexsort(places.T[::-1])[:1]
    mine = [(tuple(places[i]), index_map.local_range[0] + int(i)) for i in order]
    return min(first for owned in comm.allgather(mine) for first in owned)[1]


def _on_facets(values: Any, spaces: tuple[Any, Any], facets: np.ndarray) -> Any:
    return dolfinx.fem.dirichletbc(values, compat.nodes_on(spaces, facets), spaces[0])
