"""Both quantities of a turbulence model on a mesh: their unknowns, their equations, and one implicit step of them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import dolfinx
import numpy as np
import ufl
from mpi4py import MPI
from petsc4py import PETSc

from ... import compat
from ...compat import petsc
from ...errors import ConvergenceError
from ...fluid import Fluid
from ...fluid.solvers.direct import Direct
from ...fluid.space import cell_size
from ...forms import turbulence as forms
from ...mesh.domain import Domain
from ...parallel import Holder

Values = Callable[[np.ndarray], np.ndarray]
MOST_CORRECTIONS = 20
LINEAR = 1e-4  # residual of a linear system: corrections follow until they are small
LARGEST_CORRECTION = 2.0  # of a logarithm by Newton's method at once
# Factors are kept while corrections shrink by this at the least, and a0 of the difference in time stays to this share.
CONTRACTION, SAME_RATE = 0.3, 0.3
HOPEFUL, TOO_LARGE = 10, 1.0  # corrections after which one so large says that the step is too long
LARGEST_SEEN = 10.0  # of a change of a logarithm at one node


@dataclass(frozen=True)
class TurbulenceConditions:
    """Boundaries with given quantities, and walls.

    inflow: names of boundaries at which the logarithms are given, with a function of places (3, n) that returns (2, n)
    walls:  names of boundaries that are walls, or have a wall a distance beyond them
    distance: of walls beyond the mesh, or where there are none of that from which the model blends its constants
    """

    inflow: tuple[str, ...]
    values: Values
    walls: tuple[str, ...] = ()
    distance: float = 0.0


class TurbulenceFields(Holder, ABC):
    """The logarithms of k and of a second quantity in Lagrange elements of an order. Every method is collective.

    Each model of turbulence derives from it. Holds PETSc objects: use it as a context manager, or call `destroy`.

    Attributes:
        second: name of the second quantity.
        wanted: changes of a logarithm, and of a velocity over the largest speed, at a node in an iteration to a steady
            flow.
        stretched: whether cells in 2-D are so along boundary layers.
        state: function (2,) of the logarithms.
        closure: what the model says in UFL, see `forms.turbulence.residual`.
        form, of_molecules: the residual in UFL, and the viscosity of the molecules, once the turbulence is carried.
    """

    second: str
    wanted: tuple[float, float]
    stretched = False
    closure: Any
    form: Any
    of_molecules: Any

    def __init__(self, domain: Domain, surroundings: TurbulenceConditions, order: int):
        super().__init__(domain.comm)
        self.domain, self.surroundings, self.order = domain, surroundings, order
        self.space = compat.space(domain.mesh, ("Lagrange", order), (2,))
        self.state, self._before, self._older = (dolfinx.fem.Function(self.space) for _ in range(3))
        self.rate = tuple(self.constant(0.0) for _ in range(3))
        self._given = dolfinx.fem.Function(self.space)
        self._conditions = self._at_inflow()
        self.state.interpolate(surroundings.values)

    @property
    def names(self) -> str:
        """Both quantities, in words."""
        return f"k and {self.second}"

    def constant(self, value: float) -> Any:
        """A number on the mesh that recompiles nothing."""
        return dolfinx.fem.Constant(self.domain.mesh, PETSc.ScalarType(value))

    def _at_inflow(self) -> list[Any]:
        if not self.surroundings.inflow:
            return []
        self._given.interpolate(self.surroundings.values)
        facets = np.concatenate([self.domain.facets_of(name) for name in self.surroundings.inflow])
        return [
            dolfinx.fem.dirichletbc(self._given, compat.nodes_on(self.space, np.unique(facets)))
        ]

    def give(self, values: Values) -> None:
        """Take other values at the inflow. Collective."""
        self._given.interpolate(values)

    # -- what the flow sees of it ------------------------------------------------------------------

    @abstractmethod
    def viscosity(self, of_molecules: Any) -> Any:
        """The molecular and eddy viscosity, for `FlowModel.viscosity`."""

    def energy(self, logarithm: Any) -> Any:
        """k by its unknown (UFL)."""
        return ufl.exp(logarithm)

    def shear_velocity(self) -> Any:
        """u* of a layer of this k, for `FlowModel.shear_velocity`; None where walls have no law."""
        return None

    def watch(self, fluid: Fluid) -> None:
        """Enter the flow, where the eddy viscosity depends on more than both quantities."""

    def look(self) -> None:
        """Take note of the flow as it is, where the eddy viscosity depends on more than both quantities."""

    def follow(self) -> None:
        """Take note of where the mesh is, where the model depends on distances."""

    def at_walls(self, values: np.ndarray) -> np.ndarray:
        """State (local unknowns,) with what is given at walls. Not collective."""
        return values

    def watching(self, form: Any, velocity: Any) -> Any:
        """A form in which the eddy viscosity depends on a velocity (UFL) instead of the flow last looked at."""
        return form

    # -- a steady state, solved together with the flow ------------------------------------------------

    @property
    def conditions(self) -> list[Any]:
        """Dirichlet conditions on one or both logarithms."""
        return self._conditions

    @property
    def inside(self) -> Any:
        """One in the cells whose equations are solved, zero elsewhere (UFL)."""
        return 1

    def weights(self) -> np.ndarray:
        """(owned nodes,) how much both quantities matter to the flow there, from zero to one. Not collective."""
        return np.ones(self.state.function_space.dofmap.index_map.size_local)

    def impose(self) -> None:
        """Let the state be as it is given."""
        self.prepare()
        compat.impose(self.state.x.array, self._conditions)
        self.state.x.scatter_forward()
        self._before.x.array[:] = self.state.x.array

    def hold(self) -> None:
        """Make ready for a correction in steady flow; what is taken from an earlier state goes half way to that of now.

        All the way two states may take turns.
        """
        for one in self.rate:
            one.value = 0.0
        known = self._before.x.array
        known += 0.5 * (self.state.x.array - known)
        self.prepare()

    # -- its equations ------------------------------------------------------------------------------

    def carried_by(
        self, velocity: Any, of_molecules: Any, added: Any = (0, 0), carrier: Any = None
    ) -> None:
        """Compile the equations of the turbulence that a velocity carries and makes.

        Arguments are UFL; `added` (2,) is what else makes both quantities, `carrier` the velocity less the mesh's, see
        `forms.turbulence.Stream`.
        """
        mesh, unknowns, tests = (
            self.domain.mesh,
            ufl.split(self.state),
            ufl.TestFunctions(self.space),
        )
        measure = ufl.dx(domain=mesh, metadata={"quadrature_degree": 3 * self.order + 1})
        states = (unknowns, ufl.split(self._before), ufl.split(self._older))
        size = cell_size(mesh) / self.order
        stream = forms.Stream(
            velocity,
            of_molecules,
            measure,
            size,
            states[1],
            added,
            carrier,
            self.rate[0],
            self._reach,
            self.stretched,
            self._across,
            # In 3-D as many steps are needed without, and no more flows converge with it.
            balanced=self._reach is not None and self.domain.gdim == 2,
        )
        rate = [sum(a * one[i] for a, one in zip(self.rate, states, strict=True)) for i in range(2)]
        self.form = self._equations(rate, tests, stream)
        self.of_molecules = of_molecules
        self.solver: Direct | None = None  # made at the first step in time
        self.renew_factors()

    def _make_solver(self) -> Direct:
        """The solver of a step in time."""
        self._residual = compat.form(self.form)
        self._jacobian = compat.form(
            ufl.derivative(self.form, self.state, ufl.TrialFunction(self.space))
        )
        self._matrix = self.holding(petsc.create_matrix(self._jacobian))
        self._vector = self.holding(petsc.assemble_vector(self._residual))
        self._correction = self.holding(self._vector.duplicate())
        self._view = self.holding(compat.vec_view(self.state))
        return self.holding(Direct(self._matrix))

    @property
    def _reach(self) -> Any:
        """Size of a cell along a direction, for `forms.turbulence.Stream`; None: upwinding is along streamlines."""
        return None

    @property
    def _across(self) -> Any:
        """Square of the change from node to node by a slope, for `forms.turbulence.Stream`; None: any may be."""
        return None

    def _equations(self, rate: Any, tests: Any, stream: forms.Stream) -> Any:
        """The residual of both equations in UFL."""
        return forms.residual(ufl.split(self.state), rate, tests, stream, self.closure)

    def discretise_time(self, rate: Sequence[float], past: Sequence[np.ndarray]) -> None:
        """Set dK/dt = a0 K + a1 K(1) + a2 K(2), `past` being the states K(1) and K(2). Not collective."""
        for constant, value in zip(self.rate, rate, strict=True):
            constant.value = value
        for function, values in zip((self._before, self._older), past, strict=False):
            function.x.array[:] = values

    def step(
        self,
        rate: Sequence[float],
        past: Sequence[np.ndarray],
        tolerance: float,
        lasting: bool = False,
    ) -> float:
        """Solve for the state with dK/dt = a0 K + a1 K(1) + a2 K(2) from its present values; the last correction.

        It is infinite if Newton's method does not converge. The size of a correction is the largest of a logarithm.
        With `lasting` factors serve on, also those of steps before, while corrections with them shrink well.
        """
        self.solver = self.solver or self._make_solver()
        fresh = not lasting or abs(rate[0] - self._rate_of_factors) > SAME_RATE * abs(rate[0])
        before = np.inf
        self.discretise_time(rate, past)
        for number in range(1, MOST_CORRECTIONS + 1):
            size = self._correct(fresh)
            if size <= tolerance:
                return size
            if not np.isfinite(size):
                break
            fresh, before = not lasting or size > CONTRACTION * before, size
            if number >= HOPEFUL and size > TOO_LARGE:
                break
        self.renew_factors()
        return float("inf")

    def renew_factors(self) -> None:
        """Request new factors at the next step. Not collective, but to be called on every rank."""
        self._rate_of_factors = np.inf

    def _correct(self, fresh: bool) -> float:
        """One correction, with the matrix of the present state or the one before; its size, infinite if it fails."""
        conditions = self._conditions
        assert self.solver is not None
        self.prepare()
        with self._vector.localForm() as local:
            local.set(0.0)
        petsc.assemble_vector(self._vector, self._residual)
        petsc.apply_lifting(self._vector, [self._jacobian], [conditions], [self._view], -1.0)
        self._vector.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
        petsc.set_bc(self._vector, conditions, self._view, -1.0)
        if fresh:
            self._matrix.zeroEntries()
            petsc.assemble_matrix(self._matrix, self._jacobian, conditions)
            self._matrix.assemble()
            self._rate_of_factors = float(self.rate[0].value)
        try:
            self.solver.solve(self._vector, self._correction, LINEAR, fresh=fresh)
        except ConvergenceError:  # a matrix that is singular, or not finite
            return float("inf")
        values = self._correction.array_r
        size = self.largest(values)
        part = min(1.0, LARGEST_CORRECTION / size) if np.isfinite(size) and size > 0.0 else 1.0
        self.state.x.array[: len(values)] -= part * values
        self.state.x.scatter_forward()
        return size

    def usual_change(self, values: np.ndarray) -> float:
        """Root mean square of a change (owned unknowns,), by the weights of the nodes. Collective."""
        sizes = np.where(np.isfinite(values), np.abs(values), np.inf)
        if not np.isfinite(self.domain.comm.allreduce(sizes.sum())):
            return float("inf")
        weights = self.weights()
        seen = np.repeat(weights, 2)[: len(sizes)] * np.minimum(sizes, LARGEST_SEEN)
        total, count = (
            self.domain.comm.allreduce(float((seen**2).sum())),
            self.domain.comm.allreduce(float((weights**2).sum())),
        )
        return float(np.sqrt(0.5 * total / count))

    def prepare(self) -> None:
        """Make ready for a correction, where a model has data that depend on the state."""

    # -- its values -----------------------------------------------------------------------------------

    def largest(self, values: np.ndarray) -> float:
        """The largest size of values over all ranks; infinite if one is no number."""
        mine = float(np.abs(values).max(initial=0.0))
        return float(self.domain.comm.allreduce(mine if np.isfinite(mine) else np.inf, op=MPI.MAX))
