"""Data of the flow's Jacobian, and the interface of linear solvers."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
import ufl

from ... import compat
from ...errors import UnsolvedError
from ...forms import ReferenceMap
from ...parallel import Owner
from ..space import TaylorHood

if TYPE_CHECKING:
    from ..surface import SurfaceLoad

NOT_FINITE = (
    "the linear system of the flow is not finite, its numbers have overflowed: use a smaller fluid.reynolds or, with "
    "[time], a smaller time.step"
)


@dataclass(frozen=True)
class Equations:
    """Terms of the Jacobian [[F, G], [B, 0]] in UFL, which follow the state.

    outflow:       measure of boundaries with a given pressure; None: pressure up to a constant
    viscosity:     None: no stresses, as in the projection onto divergence-free velocities
    rate:          coefficient a0 of the velocity in its time derivative; None: steady
    carrier:       convecting velocity relative to the mesh; None: no convection
    upwind_size:   cell size over element order
    """

    space: TaylorHood
    dirichlet: Sequence[Any]
    outflow: Any
    viscosity: Any
    reference_map: ReferenceMap
    rate: Any = None
    carrier: Any = None
    upwind_size: Any = None
    surface: SurfaceLoad | None = None

    def held(self) -> np.ndarray:
        index_map = self.space.mixed.dofmap.index_map
        is_held = np.zeros(index_map.size_local + index_map.num_ghosts, dtype=bool)
        for condition in self.dirichlet:
            is_held[condition.dof_indices()[0]] = True
        return is_held

    def owned_held(self) -> np.ndarray:
        return self.held()[: self.space.mixed.dofmap.index_map.size_local]

    def measure(self) -> Any:
        degree = {"quadrature_degree": 2 * self.space.order}
        return ufl.dx(domain=self.space.mixed.mesh, metadata=degree)

    def owned_pressures(self) -> np.ndarray:
        return self.space.pressure_map[: self.space.pressure.dofmap.index_map.size_local]

    def constant_pressures(self) -> np.ndarray:
        """Normalised constant pressure, (owned unknowns,). Collective."""
        constant = np.zeros(self.space.mixed.dofmap.index_map.size_local)
        constant[self.owned_pressures()] = 1.0
        return constant / np.sqrt(self.space.mixed.mesh.comm.allreduce(float(constant.sum())))

    @property
    def inertial(self) -> bool:
        """Whether the flow is steady with convection, for the Schur complement."""
        return self.rate is None and self.carrier is not None

    @property
    def closed(self) -> bool:
        """Whether the pressure has a free constant."""
        return self.surface is None and self.outflow is None


class LinearSolver(Owner, ABC):
    """Krylov solver of A x = b with the flow's Jacobian A, which may be reassembled. Methods are collective.

    Its preconditioner serves until iterations show its age. `matrix`: None where A is an action; `regular`: needs a
    pinned pressure in closed flow; `rough`: relative residual of `approximate`. statistics: numbers of factorisations,
    solves and krylov_iterations.
    """

    regular: ClassVar[bool]
    remedy: ClassVar[str]
    rough: float

    def __init__(self, matrix: Any):
        super().__init__()
        self.matrix, self.statistics = matrix, Counter[str]()
        self._aged, self._prepared = True, -1  # state of the matrix when last prepared
        self._solver: Any = None  # of the last solve

    def solve(
        self, b: Any, x: Any, rtol: float, fresh: bool = False, transposed: bool = False
    ) -> None:
        """Solve A x = b, or with the transpose of A, to a residual of `rtol` times b; `fresh` prepares first.

        Raises UnsolvedError for singular or non-finite A or without convergence, otherwise ConvergenceError.
        """
        if fresh or (self._aged and not self._current):
            self.prepare()
        iterations = self._iterate(b, x, rtol, transposed)
        if iterations is None and not self._current:
            self.prepare()
            iterations = self._iterate(b, x, rtol, transposed)
        if iterations is None:
            self._aged = True
            raise UnsolvedError(self._why_not_solved(b))
        self._aged = self._is_slow(iterations, rtol)
        self.statistics.update(solves=1, krylov_iterations=iterations)

    @abstractmethod
    def prepare(self) -> None:
        """Prepare for the present matrix, for example factorise it. Raises ConvergenceError."""

    def approximate(self, b: Any, x: Any) -> None:
        """Solve to the accuracy of a chord-method step, perhaps with the matrix as last prepared."""
        self.solve(b, x, self.rough)

    @abstractmethod
    def _iterate(self, b: Any, x: Any, rtol: float, transposed: bool) -> int | None:
        """Number of iterations, or None without convergence."""

    def _is_slow(self, iterations: int, rtol: float) -> bool:
        return False

    @property
    def _current(self) -> bool:
        return bool(self.matrix.stateGet() == self._prepared)

    def _why_not_solved(self, b: Any) -> str:
        if not np.isfinite(b.norm()) or not np.isfinite(self.matrix.norm()):
            return NOT_FINITE
        count, reason = self._solver.getIterationNumber(), self._solver.getConvergedReason()
        return (
            f"the linear system of the flow was not solved in {count} iterations (PETSc's reason {reason}): "
            + self.remedy
        )


def component_rows(space: TaylorHood) -> tuple[Any, np.ndarray]:
    """Space of one velocity component, and rows (gdim, local nodes) of the mixed system."""
    scalar = space.component()
    nodes = np.empty(len(space.unknowns_at_nodes), dtype=np.int64)
    nodes[compat.cell_dofs(scalar)] = compat.cell_dofs(space.velocity)
    return scalar, space.unknowns_at_nodes[nodes].T
