"""The fluid sub-problem, solved steadily or advanced in time."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext
from dataclasses import replace
from functools import cached_property
from typing import Any

import dolfinx
import numpy as np
import ufl

from .. import compat, forms
from ..arrays import Floats
from ..compat import petsc
from ..forms import terms
from ..geometry.placement import Placement
from ..mesh.domain import Domain
from ..parallel import Owner
from . import newton
from .conditions import Condition, Constraints, Velocity
from .model import FlowModel
from .solvers import SOLVERS, Direct, Equations, LinearSolver, TwoLevel
from .space import (
    TaylorHood,
    cell_size,
    geometry_function,
    geometry_rows,
    size_along,
    taylor_hood,
)

LOWEST_ORDER = 2  # of the velocity
# Newton updates of a time step after which an LU factorisation is renewed.
PATIENCE = 8
# Relative residual of Newton updates by LU factorisation in steady flow.
INNER = 1e-6
# Relative residual of derivatives and dual solutions.
EXACT = 1e-9

Stage = Callable[[str], AbstractContextManager[Any]]


class Fluid(Owner):
    """Incompressible flow in Taylor-Hood elements, scene units, unit density. Every method is collective.

    Use as a context manager, or call `destroy`. With `coarse`, the same flow in lower-order elements, linear systems
    are solved matrix-free by `solvers.TwoLevel`, upwinded in the Jacobian alone; a model with this solver makes
    its own of second order.

    Args:
        conditions: where boundaries meet the later one applies.
        reynolds: one over the molecular viscosity, in scene units.
    """

    _action_measure: Any = None  # of the matrix-free Jacobian; None: that of the residual

    def __init__(
        self,
        domain: Domain,
        model: FlowModel,
        conditions: Sequence[Condition],
        reynolds: float,
        coarse: Fluid | None = None,
    ):
        super().__init__(domain.comm)
        self.domain, self.model, self.conditions = domain, model, tuple(conditions)
        with ExitStack() as on_failure:
            on_failure.push(self)
            own = model.solver == "two-level" and coarse is None
            if own:
                below = replace(model, order=LOWEST_ORDER, solver="block")
                coarse = self.holding(Fluid(domain, below, conditions, reynolds))
            self.coarse = coarse
            self._define(reynolds)
            self.solver: LinearSolver = self.holding(self._compile())
            if own and coarse is not None:
                self.solver.statistics = coarse.solver.statistics
            on_failure.pop_all()
        self._aged = True
        self._contraction = newton.Contraction()
        self.watch: Callable[[int, float], Any] = lambda iteration, size: None
        self.stage: Stage = lambda name: nullcontext()  # times what is coupled with the flow
        self.negligible = 0.0  # root-mean-square speed of a negligible Newton update

    def _define(self, reynolds: float) -> None:
        model, mesh = self.model, self.domain.mesh
        self.reference_map = model.reference_map or forms.ReferenceMap.renewed(self.domain.gdim)
        self.space: TaylorHood = taylor_hood(mesh, model.order)
        level = (TwoLevel if self.coarse else SOLVERS[model.solver]).regular
        self.constraints = Constraints(self.domain, self.space, self.conditions, level=level)
        self.state = dolfinx.fem.Function(self.space.mixed)
        self.history = tuple(
            dolfinx.fem.Function(self.space.mixed) for _ in range(2 * model.unsteady)
        )
        self._reynolds, self._time = self.space.constant(reynolds), self.space.constant(0.0)
        self.rate = tuple(self.space.constant(0.0) for _ in range(3))
        self._acceleration = self.space.constant(0.0)
        self._extrapolation = tuple(self.space.constant(c) for c in (1.0, 0.0))
        self._shifts = tuple(geometry_function(mesh) for _ in range(2 * model.moving_mesh))
        self._rows = geometry_rows(self._shifts[0]) if self._shifts else None
        self.surface: Any = None
        if (condition := self.constraints.surface) is not None:
            from .surface import SurfaceLoad

            self.surface = SurfaceLoad(self.space, self.constraints, condition, self.rate[0])
        self.walls: Any = None
        if walls := self.constraints.friction:
            from .friction import WallLoad

            viscosities = 1 / self._reynolds, self.viscosity
            self.walls = WallLoad(self.domain, self.space, walls, viscosities, model.shear_velocity)
        order = self.coarse.space.order if self.coarse else self.space.order
        self._upwind_size = cell_size(mesh) / order
        self._kept: dict[str, Any] = {}

    def _compile(self) -> LinearSolver:
        w, q = ufl.TestFunctions(self.space.mixed)
        self._residual = compat.form(self.residual_form(w, q, upwind=self.coarse is None))
        self._vector = self.holding(petsc.assemble_vector(self._residual))
        self._correction = self.holding(self._vector.duplicate())
        equations = self._equations()
        if self.coarse is not None:
            self._action_measure, self._held = equations.measure(), equations.owned_held()
            below = self.coarse.solver, self.coarse._equations()
            return TwoLevel(self._times, equations, below)
        change = ufl.TrialFunction(self.space.mixed)
        whole = ufl.derivative(self.residual_form(w, q), self.state, change)
        self._jacobian = compat.form(whole)
        self._matrix = self.holding(petsc.create_matrix(self._jacobian))
        return SOLVERS[self.model.solver](self._matrix, equations)

    def _equations(self) -> Equations:
        held, rate = self.constraints, self.rate[0] if self.model.unsteady else None
        carrier = self.carrier(ufl.split(self.state)[0])
        outflow = self.domain.measure(*held.open) if held.open else None
        return Equations(
            *(self.space, held.dirichlet, outflow, self.viscosity),
            *(self.reference_map, rate, carrier, self._upwind_size, self.surface),
        )

    def another_solver(self, matrix: Any) -> LinearSolver:
        """Solver of the same kind, for the projection onto divergence-free velocities."""
        held, unit = self.constraints, self.space.constant(1.0)
        free = (*held.open, *([held.surface.boundary] if held.surface else []))
        projection = replace(
            self._equations(),
            rate=unit,
            outflow=self.domain.measure(*free) if free else None,
            viscosity=None,
            carrier=None,
            surface=None,
        )
        return SOLVERS[self.model.solver](matrix, projection)

    def kept(self, name: str, make: Callable[[], Any]) -> Any:
        """Cache an object under a name, such as a form that UFL analyses slowly."""
        if name not in self._kept:
            self._kept[name] = make()
        return self._kept[name]

    # -- the residual ---------------------------------------------------------------------------

    def quadrature(self, cells: np.ndarray | None = None) -> Any:
        """Measure of all cells, or of local `cells`."""
        return self.space.quadrature(cells, self.model.polynomial and self.surface is None)

    def residual_form(self, w: Any, q: Any, dx: Any = None, upwind: bool = True) -> Any:
        """UFL residual of momentum and continuity, (338) and (339), of the present state, tested with w and q.

        `dx`: a measure of cells; None: of all.
        """
        (v, p), model, at = ufl.split(self.state), self.model, self.reference_map
        viscosity, force = self.viscosity, self._body_force()
        rate, carrier = self._rate_of_change(v), self.carrier(v)
        residual = terms.internal_force(v, p, w, viscosity, at) + terms.continuity(v, q, at)
        if rate is not None:
            residual += terms.inertia(rate, w, at)
        if carrier is not None:
            residual += self._convection(v, carrier, w)
        if model.inertia and model.stabilisation:
            size = cell_size(self.domain.mesh) / model.order
            residual += terms.grad_div(v, carrier, w, viscosity, size, at)
        if model.inertia and model.upwind and upwind:
            along, known = carrier, None if model.viscosity is not None else viscosity
            if self.coarse is not None:
                # Terms that vanish with the residual double the cost of a Jacobian and do not help Newton updates.
                frozen = dolfinx.fem.Function(self.space.mixed, self.state.x)
                along, known = ufl.split(frozen)[0], None
            strong = terms.momentum(v, p, carrier, known, rate, force, at)
            size = self._upwind_size
            # In layers of thin cells the root of the volume makes the term exceed the pressure gradient.
            if model.viscosity is not None:
                size = ufl.min_value(size, size_along(self.domain.mesh, along) / model.order)
            residual += terms.streamline_upwind(strong, along, w, viscosity, size, at)
        if force is not None:
            residual += terms.body_force(force, w, at)
        residual = residual * (dx or self.quadrature())
        if self.constraints.crossings:
            residual += self._at_crossings(v, carrier, w)
        if self.walls is not None:
            residual += self.walls.integral(v, p, rate, w, q)
        return residual if self.surface is None else residual + self.surface.integral(v, w)

    def _convection(self, v: Any, carrier: Any, w: Any) -> Any:  # tests replace it
        return terms.convection(v, carrier, w, self.reference_map)

    def _at_crossings(self, v: Any, carrier: Any, w: Any) -> Any:
        n, at = ufl.FacetNormal(self.domain.mesh), self.reference_map
        backflow = self.constraints.backflow
        residual = terms.open_boundary(v, w, n, self.viscosity, at)
        # With this term 2-D flow past a grain on a rough bed does not converge (tests/end_to_end/test_rough_beds.py).
        turbulent_3d = self.domain.gdim == 3 and self.model.viscosity is not None
        if carrier is not None and (turbulent_3d or backflow is not None):
            brought = v if backflow is None else v - backflow
            residual += terms.entering_boundary(brought, carrier, w, forms.surface_vector(n, at))
        if turbulent_3d:
            # UFL estimates a quadrature degree above 150 for an eddy viscosity on curved cells.
            names = tuple(self.domain.names[boundary] for boundary in self.constraints.crossings)
            return residual * self.space.boundary_quadrature(self.domain.facets)(names)
        residual = residual * self.domain.measure(*self.constraints.crossings)
        for entry in self.constraints.entries if carrier is not None else ():
            brought = v if entry.wave is None else v - entry.wave
            entering = terms.entering_boundary(brought, carrier, w, forms.surface_vector(n, at))
            residual += entering * self.domain.measure(entry.condition.boundary)
        return residual

    def _body_force(self) -> Any:
        model = self.model
        force = None if model.body_force is None else model.body_force(self.place(), self._time)
        if model.driven is None or not model.unsteady:
            return force
        driving = self._acceleration * model.driven.velocity(self.place())
        return driving if force is None else force + driving

    def _rate_of_change(self, v: Any) -> Any:
        if not self.model.unsteady:
            return None
        velocities = [v, *(ufl.split(h)[0] for h in self.history)]
        return sum(a * u for a, u in zip(self.rate, velocities, strict=True))

    def carrier(self, v: Any) -> Any:
        model, carrier = self.model, v if self.model.inertia else None
        if model.inertia and model.unsteady and model.convection == "extrapolated":
            past = [ufl.split(h)[0] for h in self.history]
            carrier = sum(e * u for e, u in zip(self._extrapolation, past, strict=True))
        if not model.moving_mesh:
            return carrier
        # The same backward difference gives the mesh velocity; past positions are x - shift.
        of_mesh = sum(-a * shift for a, shift in zip(self.rate[1:], self._shifts, strict=True))
        return -of_mesh if carrier is None else carrier - of_mesh

    def place(self) -> Any:
        return ufl.SpatialCoordinate(self.domain.mesh) + self.reference_map.displacement

    # -- parameters -----------------------------------------------------------------------------

    @property
    def reynolds(self) -> float:
        return float(self._reynolds.value)

    @reynolds.setter
    def reynolds(self, value: float) -> None:
        self._reynolds.value = value
        if self.coarse is not None:
            self.coarse.reynolds = value

    def let_in(self, conditions: Sequence[Condition]) -> None:
        self.conditions = tuple(conditions)
        self.constraints.prescribe(conditions)
        if self.coarse is not None:
            self.coarse.let_in(conditions)

    @property
    def viscosity(self) -> Any:
        of_molecules = 1 / self._reynolds
        return of_molecules if self.model.viscosity is None else self.model.viscosity(of_molecules)

    @property
    def time(self) -> float:
        return float(self._time.value)

    @time.setter
    def time(self, value: float) -> None:
        self._time.value = value

    def discretise_time(
        self, rate: Sequence[float], extrapolation: Sequence[float], times: Sequence[float] = ()
    ) -> None:
        """Set dv/dt = a0 v + a1 v(n) + a2 v(n-1) and the extrapolation e1 v(n) + e2 v(n-1); zeros: steady.

        `times`: present and past ones, for the rate of the base flow's factor.
        """
        if not np.isclose(rate[0], float(self.rate[0].value)):
            # The factorisation of another Jacobian: how updates contract has to be measured again.
            self._contraction = replace(self._contraction, measured=0)
        constants = *self.rate, *self._extrapolation
        for constant, value in zip(constants, (*rate, *extrapolation), strict=True):
            constant.value = value
        if times and self.model.driven is not None:
            factors = map(self.model.driven.factor, times)
            self._acceleration.value = float(np.dot(rate, list(factors)))

    def load_on_displaced(self, placement: Placement) -> Floats:
        """Force and torque (2, 3) of an accelerating base flow on the fluid that a grain displaces."""
        driven = self.model.driven
        if driven is None or driven.displaced is None:
            return np.zeros((2, 3))
        return float(self._acceleration.value) * driven.displaced(placement)

    def move_mesh(self, places: np.ndarray, *past: np.ndarray) -> None:
        """Move the mesh's nodes to positions (n, 3); the two `past` ones, newest first, give the mesh velocity.

        Not collective. Give a single past state twice.
        """
        self.domain.mesh.geometry.x[:] = places
        for function, before in zip(self._shifts, past, strict=False):
            function.x.array[:] = (places - before)[self._rows, : self.space.gdim].ravel()
        self.constraints.points = self.space.velocity_points()

    # -- the state ------------------------------------------------------------------------------

    @property
    def velocity(self) -> Any:
        return self._part(self.space.velocity, self.space.velocity_map, "velocity")

    @property
    def pressure(self) -> Any:
        return self._part(self.space.pressure, self.space.pressure_map, "pressure")

    def _part(self, space: Any, places: np.ndarray, name: str) -> Any:
        part = dolfinx.fem.Function(space, name=name)
        part.x.array[:] = self.state.x.array[places]
        return part

    def begin(self, velocity: Velocity) -> None:
        """Set the velocity to that of a function (gdim, n) of positions (3, n) and time."""
        values = velocity(self.space.velocity_points().T, self.time).T
        self.state.x.array[self.space.unknowns_at_nodes] = values

    def interpolate(self, other: Fluid) -> None:
        functions = (self.velocity, self.pressure), (other.velocity, other.pressure)
        for (_, rows), mine, theirs in zip(self.space.parts, *functions, strict=True):
            mine.interpolate(theirs)
            self.state.x.array[rows] = mine.x.array
        self.state.x.scatter_forward()

    def relative(self, change: np.ndarray) -> float:
        """Root-mean-square velocity of a change (owned or local unknowns,) over that of the flow."""
        whole = self.speed()
        return self.speed(change) / whole if whole else 0.0

    def speed(self, values: np.ndarray | None = None) -> float:
        """Root-mean-square velocity of values (owned or local unknowns,); None: of the flow."""
        chosen = self.state.x.array if values is None else values
        return self._root_mean_square(chosen, *self.space.parts[0])

    def _root_mean_square(self, values: np.ndarray, part: Any, rows: np.ndarray) -> float:
        nodes, components = part.dofmap.index_map, part.dofmap.index_map_bs
        mine = values[rows[: nodes.size_local * components]]
        total = self.domain.comm.allreduce(float(mine @ mine))
        return float(np.sqrt(total / nodes.size_global))

    # -- solution -------------------------------------------------------------------------------

    def solve(
        self,
        tolerance: float,
        max_iterations: int = 25,
        watch: Callable[[int, float], Any] | None = None,
        keep_factors: bool = False,
        remember: bool = True,
    ) -> newton.NewtonReport:
        """Solve with the present parameters from the present state.

        `watch` receives number and size of each Newton update. `keep_factors` reuses factorisations in steady flow;
        `remember` also keeps their contraction.
        """
        watch = watch or self.watch
        self.constraints.update(self.time)
        kept = self.model.unsteady or keep_factors
        if self.model.linear and not kept and self.coarse is None:
            size = self.correction(False, float(np.clip(0.1 * tolerance, 1e-12, 1e-6)))
            watch(0, size)
            return newton.NewtonReport(bool(np.isfinite(size)), (size,), 0.0)
        before = self.solver.statistics["factorisations"]
        inexact = not kept and self.coarse is None
        known = self._contraction if remember else None
        fresh = self._aged and not inexact
        report = newton.solve(self, tolerance, max_iterations, watch, fresh, known, inexact)
        if remember or self.solver.statistics["factorisations"] != before:
            self._contraction = report.contraction
        self._aged = not kept or not report.converged or report.iterations > PATIENCE
        return report

    def correct(self) -> float:
        self.constraints.update(self.time)
        return self.correction(fresh=True)

    def linearise(self) -> None:
        """Renew Jacobian and factorisation at the present state."""
        state = self.state.x.array.copy()
        self.correct()
        self.state.x.array[:] = state

    def renew_factors(self) -> None:
        self._aged = True

    def correction(self, fresh: bool, rtol: float | None = None) -> float:
        """Subtract a Newton update (see `newton.System`); returns its relative size, in steady flow with the
        pressure's.
        """
        conditions = self.constraints.dirichlet
        compat.impose(self.state.x.array, conditions)
        compat.vector_of(self._residual, self._vector)
        compat.set_zero(self._vector, conditions)
        if self.coarse is None and (fresh or rtol is not None):
            compat.matrix_of(self._jacobian, conditions, self._matrix)
        if rtol is not None:
            rtol = min(rtol, INNER) if self.solver.regular else rtol
            self.solver.solve(self._vector, self._correction, rtol, fresh)
        else:
            if fresh:
                self.solver.prepare()
            self.solver.approximate(self._vector, self._correction)
        self.state.x.array[: self._correction.getLocalSize()] -= self._correction.array_r
        self.state.x.scatter_forward()
        change, whole = self.speed(self._correction.array_r), self.speed()
        size = change / whole if whole else np.inf
        if change <= self.negligible:
            size = 0.0
        return size if self.model.unsteady else max(size, self._relative_pressure())

    def _relative_pressure(self) -> float:
        change, whole = (
            self._root_mean_square(values, *self.space.parts[1])
            for values in (self._correction.array_r, self.state.x.array)
        )
        scale = whole + self.speed() ** 2
        return float(change / scale) if scale else 0.0

    def residual(self) -> np.ndarray:
        """Unconstrained residual (owned unknowns,), on boundaries the consistent nodal tractions."""
        return self.assembled(self._residual)

    def assembled(self, form: Any) -> np.ndarray:
        return np.asarray(compat.vector_of(form, self._vector).array_r.copy())

    # -- derivatives ----------------------------------------------------------------------------

    def dual(self, boundary: np.ndarray, rtol: float = EXACT) -> np.ndarray:
        """Dual solution z (local unknowns,) of the last assembled Jacobian A with boundary values.

        z equals `boundary` on prescribed boundaries, and z . A change = 0 for changes within the
        flow, to a residual of `rtol` relative to the boundary values alone.
        """
        return self.response(boundary, 0.0, rtol, transposed=True)

    def response(
        self, boundary: np.ndarray, forcing: Any, rtol: float = EXACT, transposed: bool = False
    ) -> np.ndarray:
        """Linear response of the state (local unknowns,) to a change of boundary velocities, to `rtol`.

        `boundary` (local unknowns,): change of state on carried boundaries; `forcing` (owned unknowns,): change
        of the residual from other causes. `transposed`: with the transpose of the Jacobian.
        """
        self._direction.x.array[:] = boundary
        self._vector.setArray(self._acted(transposed) + forcing)
        compat.set_zero(self._vector, self.constraints.dirichlet)
        self.solver.solve(self._vector, self._correction, rtol, transposed=transposed)
        self._direction.x.array[:] = boundary
        self._direction.x.array[: self._vector.getLocalSize()] -= self._correction.array_r
        self._direction.x.scatter_forward()
        return np.array(self._direction.x.array)

    def change_of_residual(self, change: np.ndarray) -> np.ndarray:
        """Change (owned unknowns,) of the unconstrained residual for one of the state (local unknowns,)."""
        self._direction.x.array[:] = change
        return self._acted(transposed=False)

    def _times(self, values: np.ndarray, transposed: bool) -> np.ndarray:
        """Jacobian of the present state, or its transpose, times (owned unknowns,); identity where held.

        From third order on tetrahedra, one application costs about three of a matrix, which takes twenty to
        assemble and 1.5 kB per unknown.
        """
        self._direction.x.array[: len(values)] = np.where(self._held, 0.0, values)
        self._direction.x.scatter_forward()
        return np.where(self._held, values, self._acted(transposed))

    def _acted(self, transposed: bool) -> np.ndarray:
        name = f"action, transposed: {transposed}"
        return self.assembled(self.kept(name, lambda: self._action(transposed)))

    @cached_property
    def _direction(self) -> Any:
        return dolfinx.fem.Function(self.space.mixed)

    def _action(self, transposed: bool) -> Any:
        """Compiled product of the Jacobian, or its transpose, with the direction."""
        pair = ufl.TestFunction(self.space.mixed), self._direction
        tests, change = pair[::-1] if transposed else pair
        w, q = ufl.split(tests)
        residual = self.residual_form(w, q, self._action_measure)
        return compat.form(ufl.derivative(residual, self.state, change))


@contextmanager
def lowered(fluid: Fluid) -> Iterator[Fluid]:
    """Second-order flow with the fluid's state, temporary unless the fluid has one. Collective."""
    if fluid.coarse is not None:
        fluid.coarse.interpolate(fluid)
        yield fluid.coarse
        return
    model = replace(fluid.model, order=LOWEST_ORDER)
    with Fluid(fluid.domain, model, fluid.conditions, fluid.reynolds) as coarse:
        coarse.interpolate(fluid)
        yield coarse
        fluid.solver.statistics.update(coarse.solver.statistics)


def enriched(fluid: Fluid) -> Fluid:
    """Copy of a solved flow in next-higher-order elements, to be destroyed first. Collective."""
    coarse = None if isinstance(fluid.solver, Direct) else fluid.coarse or fluid
    model = replace(fluid.model, order=fluid.model.order + 1)
    return Fluid(fluid.domain, model, fluid.conditions, fluid.reynolds, coarse)
