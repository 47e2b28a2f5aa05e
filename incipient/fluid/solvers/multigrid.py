"""Multigrid for the velocity: each component by one V-cycle of a scalar operator, from order k to order one to AMG."""

from __future__ import annotations

from typing import Any

import dolfinx
import numpy as np
import ufl
from mpi4py import MPI
from petsc4py import PETSc

from ... import compat
from ...compat import petsc
from ...forms import preconditioning
from ..space import TaylorHood
from .equations import Equations
from .options import defaults

PREFIX = "fluid_velocity_"
SMOOTHING = {
    "mg_levels_ksp_type": "chebyshev",
    "mg_levels_ksp_max_it": 3,
    "mg_levels_ksp_chebyshev_esteig": "0,0.1,0,1.1",
    "mg_levels_pc_type": "jacobi",
}
# Where something convects neither Chebyshev's iteration nor incomplete factors nor Jacobi's smooth.
CONVECTED = {
    "mg_levels_ksp_type": "richardson",
    "mg_levels_ksp_max_it": 1,
    "mg_levels_pc_type": "sor",
}
# Instead of a cycle, where a smoother is all that is asked for: symmetric relaxation, each rank by itself.
RELAXATION = {"pc_type": "sor", "pc_sor_its": 2, "pc_sor_local_symmetric": None}
RELAXED = "fluid_finer_velocity_"
ALGEBRAIC = {
    "pc_type": "hypre",
    "pc_hypre_type": "boomeramg",
    "pc_hypre_boomeramg_coarsen_type": "HMIS",
    "pc_hypre_boomeramg_interp_type": "ext+i",
    "pc_hypre_boomeramg_P_max": 4,
    "pc_hypre_boomeramg_strong_threshold": 0.5,
}
# Its own smoother, Chebyshev's iteration on Jacobi, leaves a third more iterations where something convects.
AGGREGATED = {"pc_type": "gamg", "pc_gamg_threshold": 0.01} | CONVECTED


def algebraic(prefix: str = "") -> dict[str, Any]:
    """Options of algebraic multigrid: BoomerAMG, or PETSc's own where hypre is missing, as in the wheels on PyPI."""
    chosen = ALGEBRAIC if PETSc.Sys.hasExternalPackage("hypre") else AGGREGATED
    return {f"{prefix}{name}": value for name, value in chosen.items()}


def component_rows(space: TaylorHood) -> tuple[Any, np.ndarray]:
    """The space of one velocity component, and (gdim, local nodes) the rows of the mixed system of each."""
    scalar = compat.space(space.mixed.mesh, ("Lagrange", space.order))
    nodes = np.empty(local_size(scalar), dtype=np.int64)
    nodes[compat.cell_dofs(scalar)] = compat.cell_dofs(space.velocity)
    return scalar, space.unknowns_at_nodes[nodes].T


class Levels:
    """The two spaces of one velocity component, that of the velocity and linear elements, and its operator in both.

    For smoothing only the first one is there. Below a free surface each component has an operator of its own, that of
    the unit vector `way`.

    rows: (gdim, owned nodes) which rows of the mixed system, by their local numbers, each component has
    held: (gdim, local nodes) where conditions hold
    """

    def __init__(self, equations: Equations, smoothing_only: bool = False):
        mesh = equations.space.mixed.mesh
        self.fine, places = component_rows(equations.space)
        self.coarse = None if smoothing_only else compat.space(mesh, ("Lagrange", 1))
        self.interpolation = self.coarse and compat.interpolation_matrix(self.coarse, self.fine)
        self.spaces = [space for space in (self.fine, self.coarse) if space is not None]
        self.rows = places[:, : self.fine.dofmap.index_map.size_local]
        self.held = equations.held()[places]
        self.convected = equations.block_carrier is not None
        self.upwind = self.convected and equations.viscosity is not None
        self.alike = equations.surface is None
        self.way = dolfinx.fem.Constant(mesh, np.zeros(mesh.geometry.dim))
        self.forms = [self._form(one, equations) for one in self.spaces]

    def _form(self, space: Any, equations: Equations) -> Any:
        mesh, order = space.mesh, equations.space.order
        u, w = ufl.TrialFunction(space), ufl.TestFunction(space)
        integrand = preconditioning.component(
            *(u, w),
            equations.reference_map,
            equations.viscosity,
            equations.rate,
            equations.block_carrier,
            equations.upwind_size if self.upwind else None,
        )
        found = integrand * ufl.dx(domain=mesh, metadata={"quadrature_degree": 2 * order})
        if equations.surface is not None:
            found += equations.surface.of_component(u, w, self.way)
        return compat.form(found)

    def held_in(self, held: np.ndarray) -> list[np.ndarray]:
        """Where conditions hold in the fine nodes, and from that in the coarse ones, which are corners of cells."""
        if self.coarse is None:
            return [held]
        corners = compat.cell_dofs(self.coarse)
        found = np.zeros(local_size(self.coarse), dtype=bool)
        found[corners] = held[compat.cell_dofs(self.fine)[:, : corners.shape[1]]]
        return [held, found]

    def destroy(self) -> None:
        """Free PETSc's memory."""
        if self.interpolation is not None:
            self.interpolation.destroy()


class Cycle:
    """One V-cycle of the scalar operator of a component and those alike, or relaxation alone. Collective.

    Where conditions hold at the component's nodes their rows are those of the identity.
    """

    def __init__(self, levels: Levels, component: int, transposed: bool):
        self._transposed, self._smoothing = transposed, CONVECTED if levels.convected else SMOOTHING
        self._levels, self._component = levels, component
        self._forms, places = levels.forms, levels.held_in(levels.held[component])
        self.matrices = [petsc.create_matrix(form) for form in self._forms]
        self._conditions = [
            [
                dolfinx.fem.dirichletbc(
                    dolfinx.fem.Function(space), np.flatnonzero(where).astype(np.int32)
                )
            ]
            for space, where in zip(levels.spaces, places, strict=True)
        ]
        self.interpolation = levels.interpolation and self._free_of(places, levels.interpolation)
        self._right, self._left = self.matrices[0].createVecs()
        self._cycle: Any = None

    def _free_of(self, places: list[np.ndarray], interpolation: Any) -> Any:
        """A copy of the interpolation without the nodes where conditions hold."""
        found, free = interpolation.copy(), [matrix.createVecLeft() for matrix in self.matrices]
        for vector, where in zip(free, places, strict=True):
            vector.setArray(1.0 - where[: vector.getLocalSize()])
        found.diagonalScale(*free)
        for vector in free:
            vector.destroy()
        return found

    def assemble(self) -> None:
        """Take the operators of the state as it is."""
        self._levels.way.value[:] = np.eye(len(self._levels.rows))[self._component]
        for matrix, form, conditions in zip(
            self.matrices, self._forms, self._conditions, strict=True
        ):
            matrix.zeroEntries()
            petsc.assemble_matrix(matrix, form, conditions)
            matrix.assemble()
            if self._transposed:
                matrix.transpose()
        if self._cycle is not None:
            self._cycle.destroy()
        self._cycle = self._made()

    def _made(self) -> Any:
        return self._relaxed() if self.interpolation is None else self._multigrid()

    def _relaxed(self) -> Any:
        relaxation = PETSc.PC().create(self.matrices[0].comm)
        relaxation.setOptionsPrefix(RELAXED)
        relaxation.setOperators(self.matrices[0])
        with defaults(RELAXED, RELAXATION):
            relaxation.setFromOptions()
            relaxation.setUp()
        return relaxation

    def _multigrid(self) -> Any:
        cycle = PETSc.PC().create(self.matrices[0].comm)
        cycle.setOptionsPrefix(PREFIX)
        cycle.setOperators(self.matrices[0])
        cycle.setType("mg")
        cycle.setMGLevels(2)
        cycle.setMGInterpolation(1, self.interpolation)
        cycle.getMGSmoother(1).setOperators(self.matrices[0])
        coarse = cycle.getMGCoarseSolve()
        coarse.setType("preonly")
        coarse.setOperators(self.matrices[1])
        with defaults(PREFIX, self._smoothing | algebraic("mg_coarse_")):
            cycle.setFromOptions()
            cycle.setUp()
        return cycle

    def solve(self, right: np.ndarray) -> np.ndarray:
        """(owned nodes,) the approximate solution, to be copied."""
        self._right.setArray(right)
        self._cycle.apply(self._right, self._left)
        return self._left.array_r

    def multiply(self, right: np.ndarray, transposed: bool) -> np.ndarray:
        """(owned nodes,) the operator or its transpose times a vector, to be copied."""
        self._right.setArray(right)
        operator = self.matrices[0]
        (operator.multTranspose if transposed else operator.mult)(self._right, self._left)
        return self._left.array_r

    def diagonal(self) -> np.ndarray:
        """(owned nodes,) the diagonal of the operator, to be copied."""
        self.matrices[0].getDiagonal(self._left)
        return self._left.array_r

    def destroy(self) -> None:
        """Free PETSc's memory."""
        for held in (self._cycle, self.interpolation, self._right, self._left, *self.matrices):
            if held is not None:
                held.destroy()


class Components:
    """The velocity block: one V-cycle for each component; components with the same conditions share theirs.

    With `smoothing_only` there is but the smoothing in the velocity's own elements, by relaxation.
    rows: (gdim, owned nodes) which rows of the mixed system, by their local numbers, each component has
    """

    def __init__(self, equations: Equations, smoothing_only: bool = False):
        self._levels = Levels(equations, smoothing_only)
        self.rows = self._levels.rows
        self._shared = tuple(range(len(self.rows)))
        if self._levels.alike:
            self._shared = _alike(self._levels.held, equations.space.mixed.mesh.comm)
        self._symmetric = equations.block_carrier is None
        self._cycles = self._made(transposed=False)
        self._transposed: dict[int, Cycle] = {}

    def _made(self, transposed: bool) -> dict[int, Cycle]:
        return {k: Cycle(self._levels, k, transposed) for k in sorted(set(self._shared))}

    def assemble(self) -> None:
        """Take the operators of the state as it is. Collective."""
        for cycle in self._cycles.values():
            cycle.assemble()
        self._forget_transposed()

    def solve(self, right: np.ndarray, left: np.ndarray, transposed: bool = False) -> None:
        """Solve approximately with the velocity block or its transpose, both (owned rows of the mixed system,).

        Other rows of `left` stay as they are. Collective.
        """
        cycles = self._cycles
        if transposed and not self._symmetric:
            if not self._transposed:
                self._transposed = self._made(transposed=True)
                for cycle in self._transposed.values():
                    cycle.assemble()
            cycles = self._transposed
        for rows, k in zip(self.rows, self._shared, strict=True):
            left[rows] = cycles[k].solve(right[rows])

    def multiply(self, right: np.ndarray, transposed: bool = False) -> np.ndarray:
        """The components' own operators, or their transposes, times (owned rows of the mixed system,). Collective."""
        left = np.zeros_like(right)
        for rows, k in zip(self.rows, self._shared, strict=True):
            left[rows] = self._cycles[k].multiply(right[rows], transposed)
        return left

    def diagonal(self) -> np.ndarray:
        """(owned rows of the mixed system,) the diagonal of the components' operators, zero elsewhere."""
        found = np.zeros(self.rows.max(initial=-1) + 1)
        for rows, k in zip(self.rows, self._shared, strict=True):
            found[rows] = self._cycles[k].diagonal()
        return found

    def _forget_transposed(self) -> None:
        for cycle in self._transposed.values():
            cycle.destroy()
        self._transposed = {}

    def destroy(self) -> None:
        """Free PETSc's memory."""
        self._forget_transposed()
        for cycle in self._cycles.values():
            cycle.destroy()
        self._levels.destroy()


def _alike(held: np.ndarray, comm: MPI.Comm) -> tuple[int, ...]:
    """The first component with the same conditions as each, on all ranks. Collective."""
    number = len(held)
    same = np.array(
        [[np.array_equal(one, other) for other in held] for one in held], dtype=np.int32
    )
    comm.Allreduce(MPI.IN_PLACE, same, op=MPI.MIN)
    return tuple(int(np.flatnonzero(same[k])[0]) for k in range(number))


def local_size(space: Any) -> int:
    """Number of nodes of a space on this rank, ghosts included."""
    index_map = space.dofmap.index_map
    return int(index_map.size_local + index_map.num_ghosts)
