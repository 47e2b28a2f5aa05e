"""A scene's flow with the k-omega SST model: what enters, how the steady flow is found, how walls are resolved."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from ...arrays import Floats
from ...coupled.tractions import TractionProbe
from ...errors import ConvergenceError
from ...fluid import Fluid
from ...fluid.along_walls import AlongWall, along_resolved_wall, coarse_along
from ...mesh.domain import Domain
from ...mesh.transfer import Transfer
from ...mesh.wall_distance import distances
from ...planning.base_flow import Velocity
from ...planning.resolved_walls import ResolvedWalls
from ...results.resolved_wall_report import LARGEST_CHANGE, ResolvedWallReport
from ..run_part import RunPart
from .fields import TurbulenceConditions, Values
from .iteration import Round, solve_steadily
from .k_omega_sst import KOmegaSST, Sand
from .part import ORDER, Solving, TurbulentFlow
from .pseudo_time import FIRST, NEAR, Marching, solve_together

LEAST = (
    1e-3  # k over u*^2, as little as nothing; without it ln k falls for ever in crevices of a bed
)
# u* d/nu up to which a flow in space is found from the start; faster ones from slower ones, each faster by a factor,
# and of a factor what is not worth a slower flow.
FOUND_AT_ONCE, FASTER, SLIGHTLY = 100.0, 1.6, 0.5
# u* d/nu of a flow that is not found over that of a slower one, up to which no other is sought between; and of the
# slowest that may lead to one that is not found from the start: past a grain of a random bed at 100 the flow was not.
NEAREST, SLOWEST_TO_LEAD = 1.1, 25.0
# u* d/nu from which on a flow in space needs care (`fast` in `Marching`), and of the first one that leads to it.
# Past one grain of a random bed, on a mesh for 300, the flow at 100 was lost from the start (steps of 0.08 cells after
# seven), that at 40 found. Past the bead at 138 care and slower flows from 40 take more than 260 s in place of 239.
FAST, SLOWEST = 200.0, 40.0
# k over V^2 that is added to k in its unknown where the edge of a boundary layer would be a front of ln k.
ADDED = 1e-4
# u* d/nu beyond which a flow in the plane is found from that on a coarser mesh, not by turns, which finds slower ones.
COARSER_BEYOND = 100.0
FROM_COARSER = 20.0  # Courant number of the first step from a flow on a coarser mesh
BY_TURNS = 0.1  # change up to which flow and turbulence are solved by turns before they are solved together


def slower_flows(number: float) -> tuple[float, ...]:
    """u* d/nu of the flows in space that lead to one with this u* d/nu, ascending; none where it is found at once."""
    if number <= FOUND_AT_ONCE * FASTER**SLIGHTLY:
        return ()
    slowest = SLOWEST if number > FAST else FOUND_AT_ONCE
    apart = math.log(number / slowest)
    count = math.ceil(apart / math.log(FASTER) - SLIGHTLY)
    return tuple(slowest * math.exp(apart * i / count) for i in range(count))


def flow_between(found: float, number: float) -> float | None:
    """u* d/nu of a flow that leads from one that was found, 0: none, to one that was not; None: none does."""
    between = math.sqrt(found * number) if found else number / FASTER
    return None if number < NEAREST * found or between < SLOWEST_TO_LEAD else between


class KOmegaFlow(TurbulentFlow):
    """The k-omega SST model in a scene's flow, judged by the cells at its walls. Every method is collective."""

    fields: KOmegaSST
    _started = False  # from a flow on another mesh, in space also from another one of a search
    _spread = 0.0  # of the loads on the grain, else on the bed, over their size, where the flow still changes

    def _made(self, domain: Domain) -> KOmegaSST:
        walls, left = self._walls, self._setup.sides.left
        given = TurbulenceConditions((left,), self._logarithms, walls.names)
        order = self._setup.order.number
        return KOmegaSST(
            domain,
            given,
            ORDER,
            self._scene.viscosity,
            order,
            self._least,
            Sand(walls.roughness, walls.rough, walls.shear_velocity**2),
            in_layers=not walls.plane,
            added=self._added,
        )

    def _entering(self) -> tuple[Velocity, Values]:
        return self._walls.velocity, self._logarithms

    def _logarithms(self, x: Floats) -> Floats:
        """(2, n) of what enters at places (3, n)."""
        return self._floored(self._walls.logarithms(x))

    def _floored(self, logarithms: Floats) -> Floats:
        """(2, n) with k at least what is not destroyed, and what is added to it."""
        log_k, log_omega = logarithms
        k = (
            np.maximum(np.exp(log_k), self._least)
            if not self._added
            else np.exp(log_k) + self._added
        )
        return np.array([np.log(k), log_omega])

    def _give(self, fluid: Fluid) -> None:
        """Let inflow and walls be those of the setup as it is now."""
        super()._give(fluid)
        self.fields.stand(self._scene.viscosity, self._walls.shear_velocity**2)
        if (
            self._scene.gdim == 2
        ):  # in space where wakes linger loads go elsewhere with it, by less than they change
            self.fields.keep(self._least)

    @property
    def _least(self) -> float:
        return float(LEAST * self._walls.shear_velocity**2)

    @property
    def _least_carried(self) -> float:
        """That below which k is not destroyed."""
        return math.log(max(self._least, self._added))

    @property
    def _added(self) -> float:
        layer = self._walls.layer_over_forms
        return ADDED * self._scene.reference_velocity**2 if layer else 0.0

    @property
    def _walls(self) -> ResolvedWalls:
        return self._setup.resolved_walls

    @property
    def _depth(self) -> float:
        return self._walls.depth

    def solve(self, run: Solving, factor: float = 1.0, onwards: bool = False) -> bool:
        """Find the steady flow with its turbulence as `TurbulentFlow.solve` does, in space from slower ones.

        A flow that is not found from a slower one is sought from one half way between both, one that is not found from
        the start from a slower one.
        """
        if self._scene.gdim == 3:
            self._started = onwards
        if self._scene.gdim == 2 or onwards or self._walls.plane:
            return super().solve(run, factor, onwards)
        own = self._number(self._of_run.faster(factor).resolved_walls)
        before, ahead = 0.0, [*slower_flows(own), own]
        while True:
            number, kept = ahead[0], [one.x.array.copy() for one in self._both]
            try:
                if len(ahead) == 1:
                    return super().solve(run, factor, before > 0.0)
                self._lead(
                    run,
                    factor * number / own,
                    Marching(nearly=True, fast=own > FAST, onwards=before > 0.0),
                )
                before = ahead.pop(0)
            except ConvergenceError:
                between = flow_between(before, number)
                if between is None:
                    raise
                ahead.insert(0, between)
                for state, values in zip(self._both, kept, strict=True):
                    state.x.array[:] = values

    @property
    def _both(self) -> tuple[Any, Any]:
        """The states of the flow and of its turbulence."""
        return self._fluid.state, self.fields.state

    def _lead(self, run: Solving, factor: float, how: Marching) -> None:
        """Find a slower flow that leads to the scene's, its speed over this one's a factor, nearly."""
        self._take(self._fluid, factor)
        if not how.onwards:
            self.enter(self._fluid)
        with run.stage("flow"), self._timed():
            solve_together(self._fluid, self.fields, self._tolerance, how)

    def _number(self, walls: ResolvedWalls) -> float:
        """u* d/nu of the flow along these walls, d the size of the grain, or else of the bed's forms."""
        geometry = self._of_run.geometry
        size = geometry.bed.feature if geometry.grain is None else geometry.grain.size
        return float(size / walls.unit)

    def _steady(
        self, watch: Callable[[Round], None], loads: Callable[[], Floats] | None = None
    ) -> tuple[Round, ...]:
        """Between plane walls by turns; past forms and small grains in the plane that may be a start."""
        if self._walls.plane:
            return super()._steady(watch)
        rounds: tuple[Round, ...] = ()
        by_turns = self._scene.gdim == 2 and not self._past_large_grain
        if by_turns and not self._started:
            time = self._depth / self._scene.reference_velocity
            with suppress(ConvergenceError):
                rounds = solve_steadily(
                    self._fluid, self.fields, time, BY_TURNS, watch, self._timed, 1.0
                )
            if not rounds:
                self.enter(self._fluid)
        with self._timed():
            first = NEAR if rounds else FROM_COARSER if self._started else FIRST
            gently = self._walls.layer_over_forms and not rounds
            fast = self._scene.gdim == 3 and self._number(self._walls) > FAST
            how = Marching(first, gently=gently, fast=fast, onwards=fast or self._started)
            rounds += solve_together(self._fluid, self.fields, self._tolerance, how, watch, loads)
            self._spread = rounds[-1].spread
            return rounds

    @property
    def coarser_first(self) -> bool:
        """Where a boundary layer goes over forms, and past large grains: it separates, far from what enters."""
        if self._walls.layer_over_forms:
            return True
        if self._scene.gdim == 3 or self._scene.time is not None:
            return False
        return self._past_large_grain

    @property
    def _past_large_grain(self) -> bool:
        grain = self._of_run.geometry.grain
        return grain is not None and bool(grain.size > COARSER_BEYOND * self._walls.unit)

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

    def _loads(self, run: Solving) -> Callable[[], Floats]:
        """A function that returns force and couple over the grain's size, (6,), or else the force on the bed, (3,)."""
        probe, grain = run.probe, self._of_run.geometry.grain
        if probe is None or grain is None:
            on_bed = TractionProbe(self._fluid, self._walls.names[0], (0.0, 0.0, 0.0))
            return lambda: on_bed.resultant().force
        if run.fluid is not self._fluid:  # the steady flow that one in time begins with
            probe = TractionProbe(self._fluid, probe.boundary, probe.about)

        def found() -> Floats:
            resultant = probe.resultant()
            return np.concatenate([resultant.force, resultant.couple / grain.size])

        return found

    def enter(self, fluid: Fluid) -> None:
        """Let velocity and turbulence be everywhere as what enters is at that distance from the next wall."""
        walls, space = self._walls, fluid.space.velocity
        places = space.tabulate_dof_coordinates()[:, : fluid.domain.gdim]
        away = distances(fluid.domain, walls.names, places)
        fluid.state.x.array[fluid.space.velocity_map] = walls.velocity_at(away).T.ravel()
        self.fields.begin(lambda away: self._floored(walls.logarithms_at(away)))

    def wall_report(self) -> ResolvedWallReport:
        """u* along the walls, and how thick the cells at them are."""
        scene, walls = self._scene, self._walls
        along = {
            name: along_resolved_wall(self._fluid, name, name in walls.rough)
            for name in walls.names
        }
        found, shares = (
            np.concatenate(parts)
            for parts in zip(
                *((one.shear_velocities, one.lengths) for one in along.values()), strict=True
            )
        )
        y_plus, limits, weights = self._thickness(along)
        bottom, in_plane = along[walls.names[0]], scene.gdim == 2
        mean = float(found @ shares / shares.sum())
        last = bottom.at_outflow()
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
            outside=float(np.average(y_plus > limits, weights=weights)),
            plane=walls.plane,
            reach=walls.depth,
            backward=bottom.backward() if in_plane else (),
            along=self._told(along) if in_plane else {},
            mesh_size=scene.numerics.mesh_size,
            thickest=walls.thickest(walls.names[-1]),
            on_sand=walls.thickest(walls.rough[0]) if walls.rough else 0.0,
            excess=float((y_plus / limits).max()),
            spread=self._spread,
            coarse_along=0.0 if walls.plane else coarse_along(along, walls.rough, LARGEST_CHANGE),
            judged_along=walls.smooth,
        )

    def _thickness(self, walls: Mapping[str, AlongWall]) -> tuple[Floats, Floats, Floats]:
        """Thickness (n,) of the cells at walls where they end, in nu/u* of the next place of a wall, on all ranks.

        And up to which (n,) they resolve that wall, and the lengths (n,) of it, in space areas, that they stand for.
        """
        places, away = self.fields.at_edge()
        at_walls, found, lengths = (
            np.concatenate([getattr(one, name) for one in walls.values()])
            for name in ("places", "shear_velocities", "lengths")
        )
        limits = np.repeat(
            [self._walls.thickest(name) for name in walls],
            [len(one.lengths) for one in walls.values()],
        )
        nearest, mine = np.empty(0, dtype=np.int64), np.empty(0)
        if len(places):
            _, nearest = cKDTree(at_walls).query(places)
            mine = away * found[nearest] / self._scene.viscosity
        gathered = self.fields.domain.comm.allgather((mine, nearest))
        thickness, nearest = (np.concatenate(parts) for parts in zip(*gathered, strict=True))
        shares = lengths / np.maximum(np.bincount(nearest, minlength=len(lengths)), 1)
        return thickness, limits[nearest], shares[nearest]

    def _told(self, walls: Mapping[str, AlongWall]) -> dict[str, dict[str, list[float]]]:
        """What is drawn of each wall, in six digits; y+ is that of the cell next to each place."""
        scene, gathered = self._scene, self.fields.domain.comm.allgather(self.fields.at_edge())
        ends, away = (np.concatenate(parts) for parts in zip(*gathered, strict=True))
        tree, drawn = cKDTree(ends), {}
        for wall, along in walls.items():
            found = along.shear_velocities
            friction = (
                2.0 * np.sign(along.velocities[:, 0]) * (found / scene.reference_velocity) ** 2
            )
            y_plus = found * away[tree.query(along.places)[1]] / scene.viscosity
            columns = {"x": along.places[:, 0], "y_plus": y_plus, "friction": friction}
            drawn[wall] = {
                name: [float(f"{one:.6g}") for one in values] for name, values in columns.items()
            }
        return drawn
