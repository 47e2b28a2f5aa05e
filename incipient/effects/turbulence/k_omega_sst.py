"""The k-omega SST model on a mesh that reaches its walls, with an analytic profile in the cells next to them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import dolfinx
import numpy as np
import ufl
from scipy.spatial import cKDTree

from ... import compat
from ...arrays import Floats, Integers
from ...errors import SceneError
from ...fluid import Fluid
from ...fluid.space import size_along
from ...forms import k_omega_sst as forms
from ...forms.turbulence import Stream
from ...mesh.cells import is_node_of
from ...mesh.domain import Domain
from ...mesh.wall_distance import cells_at, distances
from .fields import TurbulenceConditions, TurbulenceFields

ON_WALL = 0.1  # of the least distance in cells at walls: what stands for none, where omega would be infinite
FAR = 1e9  # distance where there are no walls
CALM = 0.01  # of the shear stress of the inflow: that of rough walls where the flow separates, at the least
PENALTY = 4.0  # of weak values at rough walls, times the square of the order, over the thickness of the cell
LEAST_DISTANCE = 1e-9  # of the largest one: what distances are not below at points within cells


@dataclass(frozen=True)
class Sand:
    """Rough walls: their equivalent roughness, their names, and a typical shear stress at them."""

    roughness: float = 0.0
    walls: tuple[str, ...] = ()
    stress: float = 0.0


class KOmegaSST(TurbulenceFields):
    """ln k and ln omega on a mesh, with smooth and rough walls. Every method is collective.

    In cells with a corner on a smooth wall only molecules are taken to matter: there omega = 6 nu/(beta_1 d^2), which
    is given at all their nodes, and k goes as a power of the distance d from smooth walls, which is a flux of ln k
    into the cells beyond. On rough walls both have values by u*, given weakly; a cell that touches walls of both kinds
    is one at a smooth wall.

    Args:
        viscosity: of the molecules.
        order_of_flow: of the velocity, whose strain limits the eddy viscosity.
        least: k at which no more of it is destroyed; in still corners its logarithm would fall for ever.
        sand: roughness of the walls that are rough.
        in_layers: whether layers of thin cells lie along walls that are no planes.
        added: to k in its unknown, the logarithm of both, where a boundary layer enters; 0: nothing.
    """

    second = "omega"
    # The step converges in 40 iterations, and diverges with twice as large ones (docs/contribute/defaults.md).
    wanted = 0.5, 0.05

    def __init__(
        self,
        domain: Domain,
        surroundings: TurbulenceConditions,
        order: int,
        viscosity: float,
        order_of_flow: int = 2,
        least: float = 0.0,
        sand: Sand = Sand(),
        in_layers: bool = False,
        added: float = 0.0,
    ):
        super().__init__(domain, surroundings, order)
        mesh = domain.mesh
        scalar = compat.space(mesh, ("Lagrange", order))
        self._sand = sand
        self._smooth = tuple(name for name in surroundings.walls if name not in sand.walls)
        self._distance = dolfinx.fem.Function(scalar)
        # From smooth walls, where some are rough.
        self._from_smooth = (
            dolfinx.fem.Function(scalar) if sand.walls and self._smooth else self._distance
        )
        self._beyond = dolfinx.fem.Function(compat.space(mesh, ("Discontinuous Lagrange", 0)))
        self._seen = dolfinx.fem.Function(
            compat.space(mesh, ("Lagrange", order_of_flow), (domain.gdim,))
        )
        self._fluid: Fluid | None = None
        self.stretched = added > 0.0
        self._molecules, self._least = viscosity, self.constant(least)
        self._in_layers = in_layers
        self._stress, self._little = self.constant(sand.stress), self.constant(0.0)
        self._beyond.x.array[:] = 1.0
        self._distance.x.array[:] = surroundings.distance or FAR
        self._near, self._edge, self._within, self._source, self._ends = np.empty(
            (5, 0), dtype=np.int64
        )
        self._drop = np.empty(0)
        if surroundings.walls:
            self._stand_at_walls(scalar)
        self._floor = self.constant(LEAST_DISTANCE * self.largest(self._distance.x.array))
        self.closure = forms.Closure(
            ufl.max_value(self._distance, self._floor),
            self._least,
            self.constant(added) if added else None,
        )

    # -- walls --------------------------------------------------------------------------------------

    def _stand_at_walls(self, scalar: Any) -> None:
        """Find distances and the cells at walls, and give omega there."""
        self._measure()
        self._ends = self._between(scalar, cells_at(self.domain, self.surroundings.walls))[1]
        if not self._smooth:
            self.stand(self._molecules, float(self._stress.value))
            return
        cells = cells_at(self.domain, self._smooth)
        self._beyond.x.array[compat.cell_dofs(self._beyond.function_space)[cells, 0]] = 0.0
        near, self._edge, free = self._between(scalar, cells)
        self._near, self._within = near, np.setdiff1d(near, np.union1d(free, self._entering()))
        self._find_sources()
        self._at_walls, self._inner = dolfinx.fem.Function(scalar), dolfinx.fem.Function(scalar)
        self.stand(self._molecules, float(self._stress.value))
        self._conditions += [
            self._given_of(self._at_walls, near, 1),
            self._given_of(self._inner, self._within, 0),
        ]

    def _between(self, scalar: Any, cells: Integers) -> tuple[Integers, Integers, Integers]:
        """Local nodes of cells, those that other cells have, too, and all that other cells have."""
        outer = np.setdiff1d(np.arange(len(compat.cell_dofs(scalar))), cells)
        near, free = is_node_of(scalar, cells), is_node_of(scalar, outer)
        return np.flatnonzero(near), np.flatnonzero(near & free), np.flatnonzero(free)

    def _measure(self) -> None:
        """Find the distances of the nodes from the next wall, and from the next smooth one."""
        places = self._places()
        self._distance.x.array[:] = distances(self.domain, self.surroundings.walls, places)
        if self._from_smooth is not self._distance:
            self._from_smooth.x.array[:] = distances(self.domain, self._smooth, places)

    def keep(self, least: float) -> None:
        """Let no more k be destroyed where it is this small."""
        self._least.value = least

    def stand(self, viscosity: float, stress: float) -> None:
        """Let the molecules at walls have another viscosity, and rough walls another typical shear stress."""
        self._molecules, self._stress.value = viscosity, stress
        self._little.value = stress * forms.little_k(self._sand.roughness * stress**0.5 / viscosity)
        if not self._smooth:
            return
        away = self._from_smooth.x.array[self._near]
        beside = away[away > LEAST_DISTANCE * self.largest(self._distance.x.array)]
        # Nothing is computed from omega on the wall itself: it need not be that of the cell there.
        if not (nearest := self.largest(1.0 / beside)):
            raise SceneError(
                f"numerics.mesh_size: cells at walls are thinner than {LEAST_DISTANCE:g} of the largest distance "
                "from a wall; enlarge it, or use a smaller fluid.reynolds"
            )
        least = ON_WALL / nearest
        self._at_walls.x.array[self._near] = forms.at_smooth_wall(
            viscosity, np.maximum(away, least), np
        )

    def follow(self) -> None:
        """Let distances from walls, and what is given by them, be those of the mesh where it is now."""
        if not self.surroundings.walls:
            return
        self._measure()
        self._drop = self._dropped()
        self.stand(self._molecules, float(self._stress.value))

    def at_walls(self, values: Floats) -> Floats:
        """State (local unknowns,) with what is given in the cells at walls. Not collective."""
        found = values.copy()
        if len(self._near):
            found[2 * self._near + 1] = self._at_walls.x.array[self._near]
            found[2 * self._within] = found[2 * self._source] + self._drop
        return found

    def _places(self) -> Floats:
        """Places (n, gdim) of this rank's nodes."""
        return np.asarray(
            self._distance.function_space.tabulate_dof_coordinates()[:, : self.domain.gdim]
        )

    def _entering(self) -> Integers:
        """Nodes at which both are given."""
        facets = [self.domain.facets_of(name) for name in self.surroundings.inflow]
        if not facets:
            return np.empty(0, dtype=np.int64)
        return compat.nodes_on(self.space, np.unique(np.concatenate(facets)))

    def _given_of(self, values: Any, nodes: Integers, component: int) -> Any:
        """The condition that one of both takes values at nodes."""
        pairs = [(2 * nodes + component).astype(np.int32), nodes.astype(np.int32)]
        return dolfinx.fem.dirichletbc(values, pairs, self.space.sub(component))

    def _find_sources(self) -> None:
        """For nodes within the cells at walls: the next node beyond, and what ln k is less there.

        On a rank that has none beyond they keep what they have.
        """
        edge, places, self._source = self._edge, self._places(), self._within
        if len(edge) and len(self._within):
            self._source = edge[cKDTree(places[edge]).query(places[self._within])[1]]
        self._drop = self._dropped()

    def _dropped(self) -> Floats:
        """What ln k is less at nodes within the cells at walls than at the next node beyond."""
        away = self._from_smooth.x.array
        if not len(self._edge):
            return np.zeros(len(self._within))
        beyond = away[self._source]
        return np.asarray(
            forms.EXPONENT * np.log(np.maximum(away[self._within], ON_WALL * beyond) / beyond)
        )

    def prepare(self) -> None:
        """Let ln k within the cells at smooth walls follow that beyond, as the owner of a node has it. Collective."""
        if not self._smooth:
            return
        values = self.state.x.array
        values[2 * self._within] = values[2 * self._source] + self._drop
        self.state.x.scatter_forward()
        self._inner.x.array[self._within] = values[2 * self._within]

    def begin(self, values: Callable[[Floats], Floats]) -> None:
        """Let the state be a function of distances (n,) from walls that returns (2, n)."""
        for component, one in enumerate(values(self._distance.x.array)):
            self.state.x.array[component::2] = one

    def at_edge(self) -> tuple[Floats, Floats]:
        """Places (n, gdim) of this rank's nodes between cells at walls and those beyond, and their distances (n,)."""
        edge = self._ends[self._ends < self._distance.function_space.dofmap.index_map.size_local]
        return self._places()[edge], self._distance.x.array[edge]

    @property
    def _reach(self) -> Any:
        """Stretched cells grow away from walls faster than the logarithms allow if upwinded along streamlines alone."""
        if not self._in_layers and not self.stretched:
            return None
        return lambda direction: size_along(self.domain.mesh, direction) / self.order

    @property
    def _across(self) -> Any:
        """The base class's bound; in 3-D wakes, from the slope in the reference cell.

        Not between planes: there are no wakes, and in long thin cells the bound keeps ln k from becoming steady.
        """
        if self.domain.gdim == 2 or not self._in_layers:
            return None
        jacobian = ufl.Jacobian(self.domain.mesh)

        def square(slope: Any) -> Any:
            change = ufl.dot(slope, jacobian)
            return ufl.inner(change, change) / self.order**2

        return square

    # -- equations ----------------------------------------------------------------------------------

    def viscosity(self, of_molecules: Any) -> Any:
        """The molecular and eddy viscosity, for `FlowModel.viscosity`, by the strain last looked at."""
        stream = Stream(self._seen, of_molecules, None)
        return of_molecules + self._beyond * self.closure.eddy_viscosity(
            ufl.split(self.state), stream
        )

    def energy(self, logarithm: Any) -> Any:
        """k by its unknown (UFL)."""
        return self.closure.energy(logarithm)

    def watch(self, fluid: Fluid) -> None:
        """Take the flow whose strain limits the eddy viscosity."""
        self._fluid = fluid
        self.look()

    def watching(self, form: Any, velocity: Any) -> Any:
        """A form in which the eddy viscosity depends on a velocity (UFL) instead of the flow last looked at."""
        return ufl.replace(form, {self._seen: velocity})

    @property
    def inside(self) -> Any:
        """One in the cells whose equations are solved, zero in those at walls (UFL)."""
        return self._beyond

    def weights(self) -> Floats:
        """(owned nodes,) the share of eddies in the viscosity, before strain limits it. Not collective."""
        logarithms = self.state.x.array[: 2 * self.state.function_space.dofmap.index_map.size_local]
        eddies = np.exp(np.clip(logarithms[0::2] - logarithms[1::2], -100.0, 100.0))
        return np.asarray(eddies / (self._molecules + eddies))

    def look(self) -> None:
        """Take note of the flow as it is, by whose strain the eddy viscosity is limited."""
        if self._fluid is not None:
            self._seen.interpolate(self._fluid.velocity)

    def _equations(self, rate: Any, tests: Any, stream: Stream) -> Any:
        """The residual of both equations in UFL, in the cells beyond those at walls."""
        inside = self._beyond
        form = super()._equations(rate, [inside * test for test in tests], stream)
        if self._sand.walls:
            form += self._on_rough_walls([inside * test for test in tests], stream)
        if not self._smooth:
            return form
        mesh = self.domain.mesh
        facets = self._interface()
        away = replace(self.closure, distance=ufl.max_value(self._from_smooth, self._floor))
        flux = inside * forms.from_wall(
            ufl.split(self.state), tests[0], ufl.FacetNormal(mesh), stream, away
        )
        between = ufl.dS(1, domain=mesh, subdomain_data=facets, metadata=stream.measure.metadata())
        return form + (flux("+") + flux("-")) * between

    def _on_rough_walls(self, tests: Any, stream: Stream) -> Any:
        """The terms on rough walls in UFL, by which both quantities have their values there."""
        mesh = self.domain.mesh
        across = ufl.dot(ufl.classes.ReferenceNormal(mesh), ufl.JacobianInverse(mesh))
        penalty = PENALTY * self.order**2 * ufl.sqrt(ufl.inner(across, across))
        roughness, n = self.constant(self._sand.roughness), ufl.FacetNormal(mesh)
        wall = forms.RoughWall(roughness, n, penalty, CALM * self._stress, self._little)
        given = forms.on_rough_wall(ufl.split(self.state), tests, wall, stream)
        return given * self.domain.measure(*self._sand.walls)(metadata=stream.measure.metadata())

    def _interface(self) -> Any:
        """Tags of the facets between cells at walls and those beyond."""
        mesh, gdim = self.domain.mesh, self.domain.gdim
        for dimensions in ((gdim - 1, gdim), (gdim, gdim - 1)):
            mesh.topology.create_connectivity(*dimensions)
        cells, facets = (
            mesh.topology.connectivity(*one) for one in ((gdim - 1, gdim), (gdim, gdim - 1))
        )
        inside = self._beyond.x.array[compat.cell_dofs(self._beyond.function_space)[:, 0]]
        at_walls = np.flatnonzero(inside == 0.0)
        near = np.unique(np.concatenate([np.empty(0, np.int32), *map(facets.links, at_walls)]))
        owned = near[near < mesh.topology.index_map(gdim - 1).size_local].astype(np.int32)
        found = np.array(
            [one for one in owned if inside[cells.links(one)].sum() == 1.0], dtype=np.int32
        )
        return dolfinx.mesh.meshtags(mesh, gdim - 1, found, np.ones(len(found), dtype=np.int32))
