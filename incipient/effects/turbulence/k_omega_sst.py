"""The k-omega SST model on a mesh that reaches its walls, with an analytic profile in the cells next to them."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any

import dolfinx
import numpy as np
import ufl
from scipy.spatial import cKDTree

from ... import compat
from ...arrays import Floats, Integers
from ...errors import ConvergenceError
from ...fluid import Fluid
from ...fluid.space import size_along
from ...forms import k_omega_sst as forms
from ...forms.turbulence import Stream
from ...mesh.domain import Domain
from ...mesh.transfer import Transfer
from ...mesh.wall_distance import cells_at, distances, nodes_of
from ...planning.base_flow import Velocity
from ...planning.resolved_walls import ResolvedWalls
from ...results.resolved_wall_report import ResolvedWallReport
from ..run_part import RunPart
from .along_walls import AlongWall, along_resolved_wall
from .fields import TurbulenceConditions, TurbulenceFields, Values
from .iteration import Round, solve_steadily
from .part import ORDER, Solving, TurbulentFlow
from .pseudo_time import FIRST, NEAR, solve_together

ON_WALL = 0.1  # of the least distance in cells at walls: what stands for none, where omega would be infinite
FAR = 1e9  # distance where there are no walls
LEAST = 1e-3  # k over u*^2, as little as nothing; without it ln k falls for ever in crevices of a bed
# u* d/nu up to which a flow in space is found from the start; faster ones from slower ones, each faster by a factor.
FOUND_AT_ONCE, FASTER, SLIGHTLY = 100.0, 1.6, 0.5  # and of a factor, what is not worth a slower flow
# k over V^2 that is added to k in its unknown where the edge of a boundary layer would be a front of ln k.
ADDED = 1e-4
# u* d/nu beyond which a flow in the plane is found from that on a coarser mesh: that of slower ones is found by turns.
COARSER_BEYOND = 100.0
FROM_COARSER = 20.0  # Courant number of the first step from a flow on a coarser mesh
BY_TURNS = 0.1  # change up to which flow and turbulence are solved by turns before they are solved together
CALM = 0.01  # of the shear stress of what enters: that of rough walls where the flow separates, at the least
PENALTY = 4.0  # of weak values at rough walls, times the square of the order, over the thickness of the cell
LEAST_DISTANCE = 1e-9  # of the largest one: what distances are not below at points within cells


class KOmegaSST(TurbulenceFields):
    """ln k and ln omega on a mesh, with smooth or, in the plane, rough walls. Every method is collective.

    In cells with a corner on a smooth wall only molecules are taken to matter: there omega = 6 nu/(beta_1 d^2), which
    is given at all their nodes, and k goes as a power of the distance d, which is a flux of ln k into the cells beyond.
    On rough walls both have values by u*, given weakly.

    Args:
        viscosity: of the molecules.
        order_of_flow: of the velocity, whose strain limits the eddy viscosity.
        least: k at which no more of it is destroyed; in still corners its logarithm would fall for ever.
        roughness: equivalent sand roughness of the walls, 0: smooth.
        stress: typical shear stress at rough walls.
        in_layers: whether layers of thin cells lie along walls that are no planes.
        added: to k in its unknown, the logarithm of both, along plates, where cells are stretched; 0: nothing.
        in_stream: whether the only wall is that of a grain in a uniform stream, where k has peaks.
    """

    second = "omega"

    def __init__(
        self,
        domain: Domain,
        surroundings: TurbulenceConditions,
        order: int,
        viscosity: float,
        order_of_flow: int = 2,
        least: float = 0.0,
        roughness: float = 0.0,
        stress: float = 0.0,
        in_layers: bool = False,
        added: float = 0.0,
        in_stream: bool = False,
    ):
        super().__init__(domain, surroundings, order)
        mesh = domain.mesh
        scalar = compat.space(mesh, ("Lagrange", order))
        self._distance = dolfinx.fem.Function(scalar)
        self._beyond = dolfinx.fem.Function(compat.space(mesh, ("Discontinuous Lagrange", 0)))
        self._seen = dolfinx.fem.Function(compat.space(mesh, ("Lagrange", order_of_flow), (domain.gdim,)))
        self._fluid: Fluid | None = None
        self.stretched = added > 0.0
        self._molecules, self._least, self._roughness = viscosity, least, roughness
        self._in_layers, self._in_stream = in_layers, in_stream
        self._stress, self._little = self.constant(stress), self.constant(0.0)
        self._beyond.x.array[:] = 1.0
        self._distance.x.array[:] = surroundings.distance or FAR
        self._near, self._edge, self._within, self._source = np.empty((4, 0), dtype=np.int64)
        self._drop = np.empty(0)
        if surroundings.walls:
            self._stand_at_walls(scalar)
        floor = LEAST_DISTANCE * self.largest(self._distance.x.array)
        self.closure = forms.Closure(
            ufl.max_value(self._distance, self.constant(floor)),
            self.constant(least),
            self.constant(added) if added else None,
        )

    # -- walls --------------------------------------------------------------------------------------

    def _stand_at_walls(self, scalar: Any) -> None:
        """Find distances and the cells at walls, and give omega there."""
        walls = self.surroundings.walls
        self._distance.x.array[:] = distances(self.domain, walls, self._places())
        cells = cells_at(self.domain, walls)
        if not self._roughness:
            self._beyond.x.array[compat.cell_dofs(self._beyond.function_space)[cells, 0]] = 0.0
        near = nodes_of(scalar, cells)
        outer = np.setdiff1d(np.arange(len(compat.cell_dofs(scalar))), cells)
        free = nodes_of(scalar, outer)
        self._edge = np.intersect1d(near, free)
        if self._roughness:
            self.stand(self._molecules, float(self._stress.value))
            return
        self._near, self._within = near, np.setdiff1d(near, np.union1d(free, self._entering()))
        self._find_sources()
        self._at_walls, self._inner = dolfinx.fem.Function(scalar), dolfinx.fem.Function(scalar)
        self.stand(self._molecules, float(self._stress.value))
        self._conditions += [
            self._given_of(self._at_walls, near, 1),
            self._given_of(self._inner, self._within, 0),
        ]

    def stand(self, viscosity: float, stress: float) -> None:
        """Let the molecules at walls have another viscosity, and rough walls another typical shear stress."""
        self._molecules, self._stress.value = viscosity, stress
        self._little.value = stress * forms.little_k(self._roughness * stress**0.5 / viscosity)
        if self._roughness or not self.surroundings.walls:
            return
        away = self._distance.x.array[self._near]
        beside = away[away > LEAST_DISTANCE * self.largest(self._distance.x.array)]
        # Nothing is computed from omega on the wall itself: it need not be that of the cell there.
        least = ON_WALL / self.largest(1.0 / beside)
        self._at_walls.x.array[self._near] = forms.at_smooth_wall(viscosity, np.maximum(away, least), np)

    def follow(self) -> None:
        """Let distances from walls, and what is given by them, be those of the mesh where it is now."""
        if not self.surroundings.walls:
            return
        self._distance.x.array[:] = distances(self.domain, self.surroundings.walls, self._places())
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
        return np.asarray(self._distance.function_space.tabulate_dof_coordinates()[:, : self.domain.gdim])

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
        """For nodes within the cells at walls: the next node beyond, and what ln k is less there."""
        edge, places = self._edge, self._places()
        if not len(edge):
            self._within = self._within[:0]
        elif len(self._within):
            self._source = edge[cKDTree(places[edge]).query(places[self._within])[1]]
        self._drop = self._dropped()

    def _dropped(self) -> Floats:
        """What ln k is less at nodes within the cells at walls than at the next node beyond."""
        away = self._distance.x.array
        beyond = away[self._source]
        return np.asarray(forms.EXPONENT * np.log(np.maximum(away[self._within], ON_WALL * beyond) / beyond))

    def _prepare(self) -> None:
        """Let ln k within the cells at smooth walls follow that beyond."""
        if len(self._within):
            values = self.state.x.array
            values[2 * self._within] = values[2 * self._source] + self._drop
            self._inner.x.array[self._within] = values[2 * self._within]

    def begin(self, values: Callable[[Floats, Floats], Floats]) -> None:
        """Let the state be a function of places (n, gdim) and distances (n,) from walls that returns (2, n)."""
        for component, one in enumerate(values(self._places(), self._distance.x.array)):
            self.state.x.array[component::2] = one

    def at_edge(self) -> tuple[Floats, Floats]:
        """Places (n, gdim) of this rank's nodes between cells at walls and those beyond, and their distances (n,)."""
        edge = self._edge[self._edge < self._distance.function_space.dofmap.index_map.size_local]
        return self._places()[edge], self._distance.x.array[edge]

    @property
    def _reach(self) -> Any:
        """Stretched cells grow away from walls faster than the logarithms bear along the streams alone."""
        if not self._in_layers and not self.stretched:
            return None
        return lambda direction: size_along(self.domain.mesh, direction) / self.order

    @property
    def _across(self) -> Any:
        """In wakes, around a grain in a uniform stream and in space, by the slope in the reference cell."""
        if not self._in_stream and self.domain.gdim == 2:
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
        return of_molecules + self._beyond * self.closure.eddy_viscosity(ufl.split(self.state), stream)

    def energy(self, logarithm: Any) -> Any:
        """k by its unknown (UFL)."""
        return self.closure.energy(logarithm)

    def raise_eddy_viscosity(self, factor: float) -> None:
        """Raise the eddy viscosity by a factor, by more k: where strain limits it, less omega does not."""
        self.state.x.array[0::2] += np.log(factor)

    def watch(self, fluid: Fluid) -> None:
        """Take the flow whose strain limits the eddy viscosity."""
        self._fluid = fluid
        self.look()

    def watching(self, form: Any, velocity: Any) -> Any:
        """A form in which the eddy viscosity depends on a velocity (UFL) in place of the flow last looked at."""
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
        mesh, unknowns = self.domain.mesh, ufl.split(self.state)
        n = ufl.FacetNormal(mesh)
        if not self.surroundings.walls:
            return form
        if self._roughness:
            across = ufl.dot(ufl.classes.ReferenceNormal(mesh), ufl.JacobianInverse(mesh))
            penalty = PENALTY * self.order**2 * ufl.sqrt(ufl.inner(across, across))
            wall = forms.RoughWall(
                self.constant(self._roughness), n, penalty, CALM * self._stress, self._little
            )
            given = forms.on_rough_wall(unknowns, tests, wall, stream)
            measure = self.domain.measure(*self.surroundings.walls)
            return form + given * measure(metadata=stream.measure.metadata())
        facets = self._interface()
        flux = inside * forms.from_wall(unknowns, tests[0], n, stream, self.closure)
        between = ufl.dS(1, domain=mesh, subdomain_data=facets, metadata=stream.measure.metadata())
        return form + (flux("+") + flux("-")) * between

    def _interface(self) -> Any:
        """Tags of the facets between cells at walls and those beyond."""
        mesh, gdim = self.domain.mesh, self.domain.gdim
        for dimensions in ((gdim - 1, gdim), (gdim, gdim - 1)):
            mesh.topology.create_connectivity(*dimensions)
        cells, facets = (mesh.topology.connectivity(*one) for one in ((gdim - 1, gdim), (gdim, gdim - 1)))
        inside = self._beyond.x.array[compat.cell_dofs(self._beyond.function_space)[:, 0]]
        at_walls = np.flatnonzero(inside == 0.0)
        near = np.unique(np.concatenate([np.empty(0, np.int32), *map(facets.links, at_walls)]))
        owned = near[near < mesh.topology.index_map(gdim - 1).size_local].astype(np.int32)
        found = np.array([one for one in owned if inside[cells.links(one)].sum() == 1.0], dtype=np.int32)
        return dolfinx.mesh.meshtags(mesh, gdim - 1, found, np.ones(len(found), dtype=np.int32))


class KOmegaFlow(TurbulentFlow):
    """The k-omega SST model in a scene's flow, judged by the cells at its walls. Every method is collective."""

    fields: KOmegaSST
    _started = False  # from a flow on another mesh, in space also from a slower or faster one
    _spread = 0.0  # of the loads on the grain, over their size, where the flow still changes

    def _made(self, domain: Domain) -> KOmegaSST:
        walls, left = self._walls, self._setup.sides.left
        given = TurbulenceConditions((left,), self._logarithms, walls.names)
        order = self._setup.order.number
        in_layers = not walls.plane or self._scene.gdim == 3
        kinds = walls.roughness, walls.shear_velocity**2, in_layers, self._added, walls.around_grain
        fields = KOmegaSST(domain, given, ORDER, self._scene.viscosity, order, self._least, *kinds)
        if walls.around_grain:
            fields.begin(self._at_start)
        return fields

    def _entering(self) -> tuple[Velocity, Values]:
        return self._walls.velocity, self._logarithms

    def _logarithms(self, x: Floats) -> Floats:
        """(2, n) of what enters at places (3, n)."""
        return self._floored(self._walls.logarithms(x))

    def _floored(self, logarithms: Floats) -> Floats:
        """(2, n) with k at least what is not destroyed, and what is added to it."""
        log_k, log_omega = logarithms
        k = np.maximum(np.exp(log_k), self._least) if not self._added else np.exp(log_k) + self._added
        return np.array([np.log(k), log_omega])

    def _give(self, fluid: Fluid) -> None:
        """Let inflow and walls be those of the setup as it is now."""
        super()._give(fluid)
        self.fields.stand(self._scene.viscosity, self._walls.shear_velocity**2)

    @property
    def _least(self) -> float:
        return float(LEAST * self._walls.shear_velocity**2)

    @property
    def _added(self) -> float:
        layer = self._walls.edge is not None or self._walls.layer_over_forms
        return ADDED * self._scene.reference_velocity**2 if layer else 0.0

    @property
    def _walls(self) -> ResolvedWalls:
        return self._setup.resolved_walls

    @property
    def _depth(self) -> float:
        return self._walls.depth

    def solve(self, run: Solving, factor: float = 1.0, onwards: bool = False) -> bool:
        """Find the steady flow with its turbulence as `TurbulentFlow.solve` does, in space from slower ones."""
        if self._scene.gdim == 3:
            self._started = onwards
        slower = () if onwards or self._walls.plane or self._scene.gdim == 2 else self._slower(factor)
        for number, one in enumerate(slower):
            self._take(self._fluid, one)
            if not number:
                self.enter(self._fluid)
            with run.stage("flow"), self._timed():
                solve_together(self._fluid, self.fields, self._tolerance, nearly=True)
        return super().solve(run, factor, onwards or bool(slower))

    def _slower(self, factor: float) -> tuple[float, ...]:
        """Factors of flows that lead to the scene's times a factor, ascending, without it."""
        geometry, walls = self._of_run.geometry, self._of_run.faster(factor).resolved_walls
        size = geometry.bed.feature if geometry.grain is None else geometry.grain.size
        apart = math.log(max(size / walls.unit / FOUND_AT_ONCE, 1.0))
        number = math.ceil(apart / math.log(FASTER) - SLIGHTLY)
        return tuple(factor * math.exp(-apart * (1.0 - i / number)) for i in range(number))

    def _steady(
        self, watch: Callable[[Round], None], loads: Callable[[], Floats] | None = None
    ) -> tuple[Round, ...]:
        """Between plane walls by turns; past forms and grains in the plane they are a start, if they lead anywhere."""
        if self._walls.plane and self._walls.edge is None:
            return super()._steady(watch)
        rounds: tuple[Round, ...] = ()
        if self._scene.gdim == 2 and self._walls.edge is None and not self._started:
            time = self._depth / self._scene.reference_velocity
            with suppress(ConvergenceError):
                rounds = solve_steadily(self._fluid, self.fields, time, BY_TURNS, watch, self._timed, 1.0)
            if not rounds:
                self.enter(self._fluid)
        with self._timed():
            first = NEAR if rounds else FROM_COARSER if self._started else FIRST
            gently = self._walls.layer_over_forms and not rounds
            rounds += solve_together(
                self._fluid, self.fields, self._tolerance, watch, first, gently=gently, loads=loads
            )
            self._spread = rounds[-1].spread
            return rounds

    @property
    def coarser_first(self) -> bool:
        """Where a boundary layer goes over forms, and past large grains: it separates, far from what enters."""
        if self._walls.layer_over_forms:
            return True
        grain = self._of_run.geometry.grain
        if grain is None or self._scene.gdim == 3 or self._scene.time is not None or self._walls.around_grain:
            return False
        return bool(grain.size > COARSER_BEYOND * self._walls.unit)

    def start_from(self, coarser: RunPart) -> None:
        """Let velocity and turbulence be those of a steady flow on another mesh."""
        assert isinstance(coarser, KOmegaFlow)
        mine, theirs, mesh = self._fluid, coarser._fluid, coarser.fields.domain.mesh
        places = mine.space.velocity.tabulate_dof_coordinates()
        found = Transfer(mesh, places).values(theirs.velocity)
        mine.state.x.array[mine.space.velocity_map] = found.ravel()
        places = self.fields.space.tabulate_dof_coordinates()
        self.fields.state.x.array[:] = Transfer(mesh, places).values(coarser.fields.state).ravel()
        self._started = True

    def _loads(self, run: Solving) -> Callable[[], Floats] | None:
        """A function that returns force and couple over the grain's size, (6,); in the plane None."""
        probe, grain = run.probe, self._of_run.geometry.grain
        if probe is None or grain is None or self._scene.gdim == 2:
            return None

        def found() -> Floats:
            resultant = probe.resultant()
            return np.concatenate([resultant.force, resultant.couple / grain.size])

        return found

    def enter(self, fluid: Fluid) -> None:
        """Let velocity and turbulence be everywhere as what enters is at that distance from the next wall."""
        walls, space = self._walls, fluid.space.velocity
        places = space.tabulate_dof_coordinates()[:, : fluid.domain.gdim]
        away = distances(fluid.domain, walls.names, places)
        fluid.state.x.array[fluid.space.velocity_map] = walls.start(places, away)[0].T.ravel()
        self.fields.begin(self._at_start)

    def _at_start(self, places: Floats, away: Floats) -> Floats:
        """(2, n) of a first guess at places (n, gdim) and distances (n,) from walls."""
        return self._floored(self._walls.start(places, away)[1])

    def wall_report(self) -> ResolvedWallReport:
        """u* along the walls, and how thick the cells at them are."""
        scene, walls = self._scene, self._walls
        along = {name: along_resolved_wall(self._fluid, name) for name in walls.names}
        found, shares = (
            np.concatenate(parts)
            for parts in zip(*((one.shear_velocities, one.lengths) for one in along.values()), strict=True)
        )
        y_plus, weights = self._thickness(list(along.values()))
        bottom, in_plane = along[walls.names[0]], scene.gdim == 2
        mean, around = float(found @ shares / shares.sum()), walls.around_grain
        last = mean if around else bottom.at_outflow()
        _, away = self.fields.at_edge()
        return ResolvedWallReport(
            distance=self.fields.largest(away),
            least=float(y_plus.min()),
            largest=float(y_plus.max()),
            shear_velocity=mean,
            at_outflow=last,
            friction=2.0 * (last / scene.reference_velocity) ** 2,
            viscosity=scene.viscosity,
            c_mu=0.09,
            outside=float(np.average(y_plus > walls.thickest, weights=weights)),
            plane=walls.plane,
            reach=walls.depth,
            backward=bottom.backward() if in_plane and not around else (),
            along={name: self._told(one) for name, one in along.items()} if in_plane else {},
            mesh_size=scene.numerics.mesh_size,
            thickest=walls.thickest,
            spread=self._spread,
            separates=bottom.separates(self._centre) if around else (),
        )

    @property
    def _centre(self) -> Floats:
        """Centre (2,) of the grain."""
        placement = self._of_run.geometry.placement
        assert placement is not None
        return np.asarray(placement.centre[:2], dtype=float)

    def _thickness(self, walls: Sequence[AlongWall]) -> tuple[Floats, Floats]:
        """Thickness (n,) of the cells at walls where they end, in nu/u* of the next place of a wall, on all ranks.

        And the lengths (n,) of wall, in space areas, that they stand for.
        """
        places, away = self.fields.at_edge()
        at_walls, found, lengths = (
            np.concatenate([getattr(one, name) for one in walls])
            for name in ("places", "shear_velocities", "lengths")
        )
        nearest, mine = np.empty(0, dtype=np.int64), np.empty(0)
        if len(places):
            _, nearest = cKDTree(at_walls).query(places)
            mine = away * found[nearest] / self._scene.viscosity
        gathered = self.fields.domain.comm.allgather((mine, nearest))
        thickness, nearest = (np.concatenate(parts) for parts in zip(*gathered, strict=True))
        return thickness, (lengths / np.maximum(np.bincount(nearest, minlength=len(lengths)), 1))[nearest]

    def _told(self, along: AlongWall) -> dict[str, list[float]]:
        """What is drawn of a wall, in six digits."""
        found, scene = along.shear_velocities, self._scene
        friction = 2.0 * np.sign(along.velocities[:, 0]) * (found / scene.reference_velocity) ** 2
        y_plus = found * self.fields.largest(self.fields.at_edge()[1]) / scene.viscosity
        columns = {"x": along.places[:, 0], "y_plus": y_plus, "friction": friction}
        return {name: [float(f"{one:.6g}") for one in values] for name, values in columns.items()}
