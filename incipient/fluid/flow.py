"""The fluid sub-problem: build it once, then solve it steadily or advance it step by step."""

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
# Corrections of a time step after which the kept factors are too old.
PATIENCE = 8
# Residual, relative to the right-hand side, of corrections of a steady flow by factors, which cost little to be better.
INNER = 1e-6
# Residual, relative to the right-hand side, of what stands for an exact solution: derivatives and dual solutions.
EXACT = 1e-9


class Fluid(Holder, FlowEquations):
    """Incompressible flow on a domain in Taylor-Hood elements, scene units, fluid density one.

    Holds PETSc objects: use it as a context manager, or call `destroy`. Every method is collective.

    Args:
        domain: mesh and named boundaries.
        model: the terms present.
        conditions: boundary conditions; where boundaries meet the later one holds.
        reynolds: one over the viscosity of the molecules, in scene units.
        coarse: the same flow solved in elements of lower order: linear systems are then solved matrix-free, with
            the help of its solver (`solvers.TwoLevel`).
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
        """A copy of this flow in elements of another order; the caller destroys it. Collective."""
        model = replace(
            self.model, order=order, solver="block" if self.coarse else self.model.solver
        )
        return Fluid(self.domain, model, self.conditions, self.reynolds)

    def _one_level(self) -> LinearSolver:
        """The solver that the model names, for a matrix that is held."""
        self._matrix = self.holding(petsc.create_matrix(self._jacobian))
        return SOLVERS[self.model.solver](self._matrix, self._equations())

    def _two_level(self, coarse: Fluid) -> LinearSolver:
        """The solver by the flow in elements of lower order. The action's quadrature is that of preconditioners."""
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
        """The data from which solvers assemble the Jacobian."""
        held, rate = self.constraints, self.rate[0] if self.model.unsteady else None
        carrier = self.carrier(ufl.split(self.state)[0])
        return Equations(
            *(self.space, held.dirichlet, held.open_pressures(), self.viscosity),
            *(self.reference_map, rate, carrier, self._upwind_size(), self.surface),
        )

    def another_solver(self, matrix: Any) -> LinearSolver:
        """A solver of the fluid's kind for the projection onto velocities free of divergence. Collective."""
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
        """Solve for the state with the parameters as they are, starting from the present state.

        `watch`, or else what `Fluid.watch` has been set to, is called with the number, from zero, and the size of each
        Newton update. Earlier factorisations are reused as long as possible in a time step, or with `keep_factors`;
        with `remember` so is their contraction, see `newton.solve`.
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
        """One Newton update from the present state with a fresh factorisation; its size relative to the state."""
        self.constraints.update(self.time)
        self._lift = True
        return self.correction(fresh=True)

    @cached_property
    def _direction(self) -> Any:
        return dolfinx.fem.Function(self.space.mixed)

    def dual(self, boundary: np.ndarray, rtol: float = EXACT) -> np.ndarray:
        """The dual solution with boundary values, of the Jacobian last assembled: (local unknowns,). Collective.

        `boundary` (local unknowns,) vanishes off prescribed boundaries. The result z equals it there and makes
        z . A change = 0 for every change of the state that leaves the boundary as it is, A the Jacobian, to a residual
        of `rtol` times that of the boundary values alone.
        """
        self._completed(boundary, self.kept("transposed", self._transposed), 0.0, rtol, True)
        return np.asarray(self._direction.x.array.copy())

    def _completed(
        self, boundary: np.ndarray, action: Any, forcing: Any, rtol: float, transposed: bool = False
    ) -> None:
        """Complete boundary values in the direction so that its action and the forcing vanish off the boundary."""
        self._direction.x.array[:] = boundary
        self._vector.setArray(self.assembled(action) + forcing)
        compat.set_zero(self._vector, self.constraints.dirichlet)
        solve = self.solver.solve_transposed if transposed else self.solver.solve
        solve(self._vector, self._correction, rtol)
        self._direction.x.array[: self._vector.getLocalSize()] -= self._correction.array_r
        self._direction.x.scatter_forward()

    def _transposed(self) -> Any:
        """The transposed Jacobian times the direction: how the residual tested with it changes with the state."""
        tested = self.residual_form(*ufl.split(self._direction))
        return compat.form(ufl.derivative(tested, self.state, ufl.TestFunction(self.space.mixed)))

    def renew_factors(self) -> None:
        """Request a new factorisation at the next step. Not collective, but to be called on every rank."""
        self._aged = True

    def correction(self, fresh: bool, rtol: float | None = None) -> float:
        """Subtract a correction, by a new Jacobian if `fresh` or to a residual of `rtol` (see `newton.System`).

        Its size is relative to the flow: in steady flow the larger of velocity's and pressure's, of the latter's
        relative to itself and the square of the speed. Without a new Jacobian the state takes its boundary values
        before the residual is assembled: the columns for them would cost more than that residual, and change nothing
        where the state already has them.
        """
        renewed = self._jacobian is not None and (fresh or rtol is not None)
        if not renewed:
            compat.impose(self.state.x.array, self.constraints.dirichlet)
            self._lift = False
        self._assemble_constrained_residual()
        if renewed:
            self._assemble_jacobian()
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

    def _assemble_jacobian(self) -> None:
        self._matrix.zeroEntries()
        petsc.assemble_matrix(self._matrix, self._jacobian, self.constraints.dirichlet)
        self._matrix.assemble()

    def _assemble_constrained_residual(self) -> None:
        conditions = self.constraints.dirichlet
        self._assemble_local(self._residual)
        if self._lift:
            # Only the first correction changes boundary values; later ones vanish there.
            petsc.apply_lifting(
                self._vector, [self._jacobian], [conditions], [self._state_view], -1.0
            )
        self._vector.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
        petsc.set_bc(self._vector, conditions, self._state_view, -1.0)

    def response(
        self, boundary: np.ndarray, forcing: np.ndarray, rtol: float = EXACT
    ) -> tuple[np.ndarray, np.ndarray]:
        """The flow's response to a change of boundary velocities, to a residual of `rtol`. Collective.

        `boundary` is a change of the state (local unknowns,) that vanishes off carried boundaries, `forcing` the
        change of the residual (owned unknowns,) that has other causes. Returns the change of the
        state completed so that the residual within the flow stays as it is, and the change of the residual on
        carried boundaries (owned unknowns,), of the tractions: exact to `rtol` where the Jacobian was assembled at
        the present state. Off these boundaries the latter has no meaning.
        """
        whole, near = self.kept("actions", self._actions)
        self._completed(boundary, whole, forcing, rtol)
        return self._direction.x.array.copy(), self.assembled(near) + forcing

    def _actions(self) -> tuple[Any, Any]:
        """The Jacobian times the direction: whole, and from the cells at carried boundaries only."""
        w, q = ufl.TestFunctions(self.space.mixed)
        near = self.constraints.carried_cells()
        forms = (self.residual_form(w, q), self.residual_form(w, q, near))
        return tuple(
            compat.form(ufl.derivative(form, self.state, self._direction)) for form in forms
        )

    def residual(self) -> np.ndarray:
        """Residual of the present state against every test function, conditions not applied: (owned unknowns,).

        Its momentum entries on a boundary are the consistent nodal tractions there.
        """
        return self.assembled(self._residual)

    def assembled(self, form: Any) -> np.ndarray:
        """A compiled linear form against every test function of the mixed space: (owned unknowns,)."""
        self._assemble_local(form)
        self._vector.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
        return self._vector.array_r.copy()

    def _assemble_local(self, form: Any) -> None:
        """Assemble a linear form into the vector, without contributions of other ranks."""
        with self._vector.localForm() as local:
            local.set(0.0)
        petsc.assemble_vector(self._vector, form)

    def _relative_pressure(self) -> float:
        """The change of the pressure over itself and the square of the speed, by root mean squares. Collective."""
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
    """The fluid of a model, and the second-order one where its systems are solved by two levels. Collective.

    The latter is `Fluid.coarse`, is freed with it, and counts for the same statistics.
    """
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
    """The second-order flow of a fluid, or a temporary one, with the fluid's state. Collective."""
    if fluid.coarse is not None:
        fluid.coarse.interpolate(fluid)
        yield fluid.coarse
        return
    with fluid.at_order(LOWEST_ORDER) as coarse:
        coarse.interpolate(fluid)
        yield coarse
        fluid.solver.statistics.add(coarse.solver.statistics)


def enriched(fluid: Fluid) -> Fluid:
    """A copy of a solved flow in next-higher-order elements; the caller destroys the copy first. Collective.

    An iterative solver of the flow serves the solver of the copy. The copy's Jacobian is then upwinded as the flow is,
    its residual is not: it consists of the discretisation error of the flow's elements and the effect of upwinding.
    """
    order, model = fluid.model.order, fluid.model
    if isinstance(fluid.solver, Direct):
        return fluid.at_order(order + 1)
    model = replace(model, order=order + 1, upwind_order=model.upwind_order or order, exact=True)
    return Fluid(fluid.domain, model, fluid.conditions, fluid.reynolds, fluid.coarse or fluid)
