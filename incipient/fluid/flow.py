"""The fluid sub-problem, solved steadily or advanced in time."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from functools import cached_property, partial
from typing import Any

import dolfinx
import numpy as np
import ufl
from petsc4py import PETSc

from .. import compat
from ..compat import petsc
from ..mesh.domain import Domain
from ..parallel import Holder
from . import newton
from .conditions import Condition
from .flow_equations import FlowEquations
from .model import FlowModel
from .solvers import SOLVERS, Direct, Equations, LinearSolver, TwoLevel
from .solvers.two_level import Action, PressureForce

LOWEST_ORDER = 2  # of the velocity
# Newton updates of a time step after which an LU factorisation is renewed.
PATIENCE = 8
# Relative residual of Newton updates by LU factorisation in steady flow.
INNER = 1e-6
# Relative residual of derivatives and dual solutions.
EXACT = 1e-9


class Fluid(Holder, FlowEquations):
    """Incompressible flow in Taylor-Hood elements, scene units, unit density. Every method is collective.

    Use as a context manager, or call `destroy`. With `coarse`, the same flow in lower-order
    elements, linear systems are solved matrix-free by `solvers.TwoLevel`.
    """

    def __init__(
        self,
        domain: Domain,
        model: FlowModel,
        conditions: Sequence[Condition],
        reynolds: float,
        coarse: Fluid | None = None,
    ):
        level = (TwoLevel if coarse else SOLVERS[model.solver]).regular
        Holder.__init__(self, domain.comm)
        FlowEquations.__init__(self, domain, model, conditions, reynolds, level, coarse)
        w, q = ufl.TestFunctions(self.space.mixed)
        self._residual = compat.form(self.residual_form(w, q, upwind=not model.exact))
        self._jacobian = None if coarse else self._compiled_jacobian()
        self.coarse = coarse
        with ExitStack() as on_failure:
            on_failure.push(self)
            self._vector = self.holding(petsc.assemble_vector(self._residual))
            self._correction = self.holding(self._vector.duplicate())
            self._state_view = self.holding(compat.vec_view(self.state))
            self.solver: LinearSolver = self.holding(
                self._two_level(coarse) if coarse else self._one_level()
            )
            on_failure.pop_all()
        self._lift, self._aged = True, True
        self._contraction = newton.Contraction()
        self.watch: Callable[[int, float], Any] = lambda iteration, size: None
        self.negligible = 0.0  # root-mean-square speed of a negligible Newton update

    def at_order(self, order: int) -> Fluid:
        model = replace(
            self.model, order=order, solver="block" if self.coarse else self.model.solver
        )
        return Fluid(self.domain, model, self.conditions, self.reynolds)

    def _one_level(self) -> LinearSolver:
        self._matrix = self.holding(petsc.create_matrix(self._jacobian))
        return SOLVERS[self.model.solver](self._matrix, self._equations())

    def _two_level(self, coarse: Fluid) -> LinearSolver:
        equations = self._equations()
        measure = ufl.dx(
            domain=self.domain.mesh, metadata={"quadrature_degree": 2 * self.space.order}
        )
        action = Action(
            self.state, partial(self.residual_form, measure=measure), equations.owned_held()
        )
        force = PressureForce(self.space, partial(self.pressure_force, measure))
        actions = self.holding(action).times, self.holding(force)
        return TwoLevel(*actions, equations, (coarse.solver, coarse._equations()))

    def _compiled_jacobian(self) -> Any:
        whole = self.residual_form(*ufl.TestFunctions(self.space.mixed))
        return compat.form(ufl.derivative(whole, self.state, ufl.TrialFunction(self.space.mixed)))

    def _equations(self) -> Equations:
        held, rate = self.constraints, self.rate[0] if self.model.unsteady else None
        carrier = self.carrier(ufl.split(self.state)[0])
        return Equations(
            *(self.space, held.dirichlet, held.open_pressures(), self.viscosity),
            *(self.reference_map, rate, carrier, self._upwind_size(), self.surface),
        )

    def another_solver(self, matrix: Any) -> LinearSolver:
        """Solver of the same kind, for the projection onto divergence-free velocities."""
        one = self.space.constant(1.0)
        free = self.constraints.open_pressures(self.constraints.surface)
        projection = replace(
            self._equations(), viscosity=None, rate=one, carrier=None, surface=None, open=free
        )
        return SOLVERS[self.model.solver](matrix, projection)

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
        self._lift, kept = True, self.model.unsteady or keep_factors
        if self.model.linear and not kept and self.coarse is None:
            size = self.correction(False, float(np.clip(0.1 * tolerance, 1e-12, 1e-6)))
            watch(0, size)
            return newton.NewtonReport(bool(np.isfinite(size)), (size,), 0.0)
        before = self.solver.statistics.factorisations
        inexact = not kept and self.coarse is None
        known = self._contraction if remember else None
        fresh = self._aged and not inexact
        report = newton.solve(self, tolerance, max_iterations, watch, fresh, known, inexact)
        if remember or self.solver.statistics.factorisations != before:
            self._contraction = report.contraction
        self._aged = not kept or not report.converged or report.iterations > PATIENCE
        return report

    def correct(self) -> float:
        self.constraints.update(self.time)
        self._lift = True
        return self.correction(fresh=True)

    @cached_property
    def _direction(self) -> Any:
        return dolfinx.fem.Function(self.space.mixed)

    def dual(self, boundary: np.ndarray, rtol: float = EXACT) -> np.ndarray:
        """Dual solution z (local unknowns,) of the last assembled Jacobian A with boundary values.

        z equals `boundary` on prescribed boundaries, and z . A change = 0 for changes within the
        flow, to a residual of `rtol` relative to the boundary values alone.
        """
        self._completed(boundary, self.kept("transposed", self._transposed), 0.0, rtol, True)
        return np.asarray(self._direction.x.array.copy())

    def _completed(
        self, boundary: np.ndarray, action: Any, forcing: Any, rtol: float, transposed: bool = False
    ) -> None:
        """Complete boundary values so that the direction's action plus the forcing vanishes off the boundary."""
        self._direction.x.array[:] = boundary
        self._vector.setArray(self.assembled(action) + forcing)
        compat.set_zero(self._vector, self.constraints.dirichlet)
        self.solver.solve(self._vector, self._correction, rtol, transposed=transposed)
        self._direction.x.array[: self._vector.getLocalSize()] -= self._correction.array_r
        self._direction.x.scatter_forward()

    def _transposed(self) -> Any:
        tested = self.residual_form(*ufl.split(self._direction))
        return compat.form(ufl.derivative(tested, self.state, ufl.TestFunction(self.space.mixed)))

    def renew_factors(self) -> None:
        self._aged = True

    def correction(self, fresh: bool, rtol: float | None = None) -> float:
        """Subtract a Newton update (see `newton.System`); returns its relative size, in steady flow with the
        pressure's.
        """
        renewed = self._jacobian is not None and (fresh or rtol is not None)
        if not renewed:
            compat.impose(self.state.x.array, self.constraints.dirichlet)
            self._lift = False
        self._assemble_constrained_residual()
        if renewed:
            compat.matrix_of(self._jacobian, self.constraints.dirichlet, self._matrix)
        if rtol is not None:
            rtol = min(rtol, INNER) if self.solver.regular else rtol
            self.solver.solve(self._vector, self._correction, rtol, fresh)
        else:
            if fresh:
                self.solver.prepare()
            self.solver.approximate(self._vector, self._correction)
        owned = self._state_view.getLocalSize()
        self.state.x.array[:owned] -= self._correction.array_r
        self.state.x.scatter_forward()
        self._lift, size = False, self._relative_size()
        return size if self.model.unsteady else max(size, self._relative_pressure())

    def _assemble_constrained_residual(self) -> None:
        conditions = self.constraints.dirichlet
        with self._vector.localForm() as local:
            local.set(0.0)
        petsc.assemble_vector(self._vector, self._residual)
        if self._lift:
            # Only the first update changes boundary values.
            petsc.apply_lifting(
                self._vector, [self._jacobian], [conditions], [self._state_view], -1.0
            )
        self._vector.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
        petsc.set_bc(self._vector, conditions, self._state_view, -1.0)

    def response(
        self, boundary: np.ndarray, forcing: np.ndarray, rtol: float = EXACT
    ) -> tuple[np.ndarray, np.ndarray]:
        """Linear response of the flow to a change of boundary velocities.

        `boundary` (local unknowns,): change of state on carried boundaries; `forcing` (owned unknowns,): change
        of the residual from other causes. Returns the changes of the state and, on carried boundaries, of the
        tractions (owned unknowns,), to `rtol`.
        """
        whole, near = self.kept("actions", self._actions)
        self._completed(boundary, whole, forcing, rtol)
        return self._direction.x.array.copy(), self.assembled(near) + forcing

    def _actions(self) -> tuple[Any, Any]:
        w, q = ufl.TestFunctions(self.space.mixed)
        near = self.constraints.carried_cells()
        forms = (self.residual_form(w, q), self.residual_form(w, q, near))
        return tuple(
            compat.form(ufl.derivative(form, self.state, self._direction)) for form in forms
        )

    def residual(self) -> np.ndarray:
        """Unconstrained residual (owned unknowns,), on boundaries the consistent nodal tractions."""
        return self.assembled(self._residual)

    def assembled(self, form: Any) -> np.ndarray:
        return np.asarray(compat.vector_of(form, self._vector).array_r.copy())

    def _relative_pressure(self) -> float:
        nodes = self.space.pressure.dofmap.index_map
        owned = self.space.pressure_map[: nodes.size_local]
        parts = [values[owned] for values in (self._correction.array_r, self.state.x.array)]
        sums = self.domain.comm.allreduce(np.array([part @ part for part in parts]))
        change, whole = np.sqrt(sums / nodes.size_global)
        scale = float(whole) + self.speed() ** 2
        return float(change) / scale if scale else 0.0

    def _relative_size(self) -> float:
        parts = [
            values[self._owned_velocities]
            for values in (self._correction.array_r, self.state.x.array)
        ]
        change, whole = self.domain.comm.allreduce(np.array([part @ part for part in parts]))
        if change <= self.negligible**2 * self.space.velocity_nodes():
            return 0.0
        return float(np.sqrt(change / whole)) if whole else np.inf


def build_fluid(
    domain: Domain, model: FlowModel, conditions: Sequence[Condition], reynolds: float
) -> Fluid:
    """Build the fluid of a model, with a second-order `Fluid.coarse` for the two-level solver. Collective."""
    if model.solver != "two-level":
        return Fluid(domain, model, conditions, reynolds)
    coarse = Fluid(domain, replace(model, order=LOWEST_ORDER, solver="block"), conditions, reynolds)
    with ExitStack() as on_failure:
        on_failure.push(coarse)
        fluid = Fluid(domain, model, conditions, reynolds, coarse)
        on_failure.pop_all()
    fluid.solver.statistics = coarse.solver.statistics
    fluid.holding(coarse)
    return fluid


@contextmanager
def lowered(fluid: Fluid) -> Iterator[Fluid]:
    """Second-order flow with the fluid's state, temporary unless the fluid has one. Collective."""
    if fluid.coarse is not None:
        fluid.coarse.interpolate(fluid)
        yield fluid.coarse
        return
    with fluid.at_order(LOWEST_ORDER) as coarse:
        coarse.interpolate(fluid)
        yield coarse
        fluid.solver.statistics.add(coarse.solver.statistics)


def enriched(fluid: Fluid) -> Fluid:
    """Copy of a solved flow in next-higher-order elements, to be destroyed first. Collective.

    Its Jacobian is upwinded, its residual not.
    """
    order, model = fluid.model.order, fluid.model
    if isinstance(fluid.solver, Direct):
        return fluid.at_order(order + 1)
    model = replace(model, order=order + 1, upwind_order=model.upwind_order or order, exact=True)
    return Fluid(fluid.domain, model, fluid.conditions, fluid.reynolds, fluid.coarse or fluid)
