"""Iterative linear solver of 3-D flow: GMRES with the upper block triangle of the Jacobian."""

from __future__ import annotations

from typing import Any, ClassVar

import basix
import numpy as np
import ufl
from petsc4py import PETSc

from ... import compat
from ...errors import UnsolvedError
from ...forms import preconditioning
from ...mesh.cells import CELLS
from ...parallel import Owner
from .direct import Direct, fits
from .equations import NOT_FINITE, Equations, LinearSolver, component_rows
from .options import CHEBYSHEV, COMPONENT, GMRES, algebraic, krylov, preconditioner

# Prefixes of PETSc's options.
VELOCITY, MASS, POISSON = "fluid_velocity_", "fluid_pressure_", "fluid_pressure_poisson_"
# In steady and unsteady flow; in the latter a shorter step helps more than further iterations.
MOST_ITERATIONS, MOST_IN_TIME = 250, 200
# Iterations, relative to a new preconditioner, after which it is rebuilt, or abandoned within a solve.
AGED = 1.5
USELESS = 4.0
# Relative residual of chord-method updates in steady flow and, of the preconditioned system, in unsteady flow.
ROUGH, ROUGH_IN_TIME = 1e-3, 3e-2


class Block(LinearSolver):
    """GMRES with a block-triangular preconditioner, reused until iterations have grown by half.

    Constant pressures of closed domains are projected out. A steady flow on which GMRES fails (cylinder_in_space on
    default cells) gets an LU factorisation, memory permitting.
    """

    regular: ClassVar[bool] = False
    remedy: ClassVar[str] = (
        "use a smaller numerics.mesh_size, more memory for an LU factorisation or, with [time], a smaller time.step"
    )

    def __init__(self, matrix: Any, equations: Equations):
        super().__init__(matrix)
        self._equations, self._held = equations, equations.owned_held()
        self._usual = np.inf  # iterations per decade of the residual with a new preconditioner
        self._direct: Direct | None = None
        steady = equations.rate is None
        self._may_factorise = steady and not equations.closed
        self._symmetric = equations.carrier is None and equations.surface is None
        self._rough = ROUGH if steady else ROUGH_IN_TIME
        self._options = GMRES | {
            "ksp_pc_side": "right" if steady else "left",
            "ksp_max_it": MOST_ITERATIONS if steady else MOST_IN_TIME,
        }
        # By transposition; the solver of the transpose is built on demand.
        self._for_transpose = self.holding(Owner())
        self._solvers: dict[bool, tuple[Any, Triangle]] = {False: self._made(matrix, False)}
        self._most = self._solvers[False][0].getTolerances()[3]

    def _made(self, matrix: Any, transposed: bool) -> tuple[Any, Triangle]:
        owner, equations = self._for_transpose if transposed else self, self._equations
        triangle = Triangle(self.matrix, equations, transposed)
        if equations.closed:
            constant = owner.holding(matrix.createVecRight())
            constant.setArray(equations.constant_pressures())
            null_space = PETSc.NullSpace().create(vectors=[constant], comm=matrix.comm)
            matrix.setNullSpace(owner.holding(null_space))
            matrix.setTransposeNullSpace(null_space)
        return owner.holding(krylov(matrix, self._options, triangle)), triangle

    def prepare(self) -> None:
        if self._direct is not None:
            self._direct.prepare()
            return
        self._for_transpose.destroy()
        self._solvers = {False: self._solvers[False]}
        self._solvers[False][1].assemble()
        self.statistics.factorisations += 1
        self._aged, self._prepared, self._usual = False, self.matrix.stateGet(), np.inf

    def approximate(self, b: Any, x: Any) -> None:
        self.solve(b, x, self._rough)

    def solve(
        self, b: Any, x: Any, rtol: float, fresh: bool = False, transposed: bool = False
    ) -> None:
        transposed = transposed and not self._symmetric
        if self._direct is None:
            try:
                super().solve(b, x, rtol, fresh, transposed)
                return
            except UnsolvedError as error:
                if str(error) == NOT_FINITE or not (self._may_factorise and fits(self.matrix)):
                    raise
            self._direct = Direct(self.matrix)
            self._direct.statistics = self.statistics
        try:
            self._direct.solve(b, x, rtol, fresh, transposed)
        except UnsolvedError:  # specific to this state: the blocks may serve another
            self._direct.destroy()
            self._direct, self._prepared = None, -1
            raise

    def _is_slow(self, iterations: int, rtol: float) -> bool:
        needed = iterations / -np.log10(rtol)
        if self._current:
            self._usual = min(needed, self._usual)
            return False
        return bool(needed > AGED * self._usual)

    def _iterate(self, b: Any, x: Any, rtol: float, transposed: bool) -> int | None:
        if transposed not in self._solvers:
            matrix = self._for_transpose.holding(PETSc.Mat().createTranspose(self.matrix))
            self._solvers[True] = self._made(matrix, True)
            self._solvers[True][1].assemble()
        self._solver = self._solvers[transposed][0]
        # An old preconditioner is replaced if it needs many iterations.
        expected = -USELESS * self._usual * np.log10(rtol)
        most = self._most if self._current else int(min(self._most, 1.0 + expected))
        self._solver.setTolerances(rtol=rtol, atol=1e-50, max_it=most)
        # Rows of Dirichlet conditions are identities, whose values count in no residual.
        x.setArray(np.where(self._held, b.array_r, 0.0))
        self._solver.solve(b, x)
        return self._solver.getIterationNumber() if self._solver.getConvergedReason() > 0 else None

    def destroy(self) -> None:
        if self._direct is not None:
            self._direct.destroy()
        super().destroy()


class Triangle(Owner):
    """Upper block triangle of [[F, G], [B, 0]], or of its transpose: a `PCPYTHON` context. Methods are collective.

    z_p = -S^-1 r_p, z_v = F^-1 (r_v - G z_p), with one multigrid V-cycle for each component's block of F. S is the
    mass over the viscosity M in Stokes flow. In unsteady flow S^-1 = M^-1 + a0 A^-1 with the Laplacian A, whose
    diagonal is doubled at free outflow (Cahouet & Chabard 1988, Int. J. Numer. Methods Fluids 8, 869). In steady flow
    with inertia S^-1 = L^-1 (B D^-1 F D^-1 G) L^-1, L = B D^-1 G with the diagonal D of F, the least-squares commutator
    of Elman, Howle, Shadid, Shuttleworth & Tuminaro (2006, SIAM J. Sci. Comput. 27, 1651); F is reduced to the
    components' blocks, and G includes upwinding.
    """

    def __init__(self, matrix: Any, equations: Equations, transposed: bool = False):
        super().__init__()
        self._matrix, self._equations, self._transposed = matrix, equations, transposed
        self._commutes = equations.kind == "inertia"
        start, end = matrix.getOwnershipRange()
        parts = np.sort(component_rows(equations.space)[1])
        # Owned rows of each component, and of the pressure, ascending.
        self._rows = [part[part < end - start] for part in parts]
        self._pressures = np.sort(equations.owned_pressures())
        self._sets = [
            self.holding(_index_set(start + rows, matrix.comm))
            for rows in (*self._rows, self._pressures)
        ]
        self._forms = _of_pressure(equations)
        self._interpolations: list[Any] = []
        if equations.viscosity is not None:
            self._interpolations = [self.holding(one) for one in _interpolations(equations)]
        constants = PETSc.NullSpace().create(constant=equations.closed, comm=matrix.comm)
        self._constants, self._present = self.holding(constants), self.holding(Owner())

    def assemble(self) -> None:
        self._present.destroy()
        holding, (*each, pressure) = self._present.holding, self._sets
        self._momentum = [self._block(rows, rows) for rows in each]
        self._gradient = [self._block(rows, pressure) for rows in each]
        self._divergence = [self._block(pressure, rows) for rows in each if self._commutes]
        self._velocity = [holding(one) for one in self._momentum[0].createVecs()]
        self._pressure = [holding(self._gradient[0].createVecRight()) for _ in range(3)]
        chosen = COMPONENT | algebraic("mg_coarse_") if self._interpolations else {"pc_type": "sor"}
        interpolations = self._interpolations or [None] * len(each)
        self._cycles = [
            holding(preconditioner(block, VELOCITY, chosen, interpolation))
            for block, interpolation in zip(self._momentum, interpolations, strict=True)
        ]
        self._inverses = []
        if "mass" in self._forms:
            mass = self._ordered(compat.matrix_of(self._forms["mass"]))
            self._inverses.append(holding(preconditioner(mass, MASS, of_mass(self._equations))))
        if "laplacian" in self._forms or self._commutes:
            laplacian = self._scaled_laplacian() if self._commutes else self._laplacian()
            self._inverses.append(holding(preconditioner(laplacian, POISSON, algebraic())))

    def _block(self, rows: Any, columns: Any) -> Any:
        if not self._transposed:
            return self._present.holding(self._matrix.createSubMatrix(rows, columns))
        return self._present.holding(self._matrix.createSubMatrix(columns, rows)).transpose()

    def _ordered(self, matrix: Any) -> Any:
        """A matrix of pressures with ascending rows of the mixed system; the former one is freed."""
        order = np.argsort(self._equations.owned_pressures())
        chosen = _index_set(matrix.getOwnershipRange()[0] + order, matrix.comm)
        ordered = self._present.holding(matrix.createSubMatrix(chosen, chosen))
        for lent in (chosen, matrix):
            lent.destroy()
        return ordered

    def _laplacian(self) -> Any:
        """A/a0."""
        laplacian, open_nodes = compat.matrix_of(self._forms["laplacian"]), self._equations.open
        diagonal = laplacian.getDiagonal()
        entries = diagonal.array_r.copy()
        entries[open_nodes[open_nodes < len(entries)]] *= 2.0
        diagonal.setArray(entries)
        laplacian.setDiagonal(diagonal)
        diagonal.destroy()
        laplacian.scale(1.0 / float(self._equations.rate.value))
        return self._ordered(laplacian)

    def _scaled_laplacian(self) -> Any:
        """L; also sets the inverse diagonals D^-1 of the components."""
        self._scales = [self._present.holding(block.getDiagonal()) for block in self._momentum]
        laplacian = None
        for gradient, divergence, scale in zip(
            self._gradient, self._divergence, self._scales, strict=True
        ):
            scale.abs()
            scale.reciprocal()
            scaled = gradient.copy()
            scaled.diagonalScale(L=scale)
            product = self._present.holding(divergence.matMult(scaled))
            scaled.destroy()
            if laplacian is None:
                laplacian = product
            else:
                laplacian.axpy(1.0, product)
        return laplacian

    def apply(self, _: Any, right: Any, left: Any) -> None:
        r, z, (v, w), (p, q, _) = right.array_r, left.array, self._velocity, self._pressure
        q.setArray(r[self._pressures])
        self._solve_schur(q, p)
        p.scale(-1.0)
        z[self._pressures] = p.array_r
        for rows, gradient, cycle in zip(self._rows, self._gradient, self._cycles, strict=True):
            gradient.mult(p, w)
            v.setArray(r[rows] - w.array_r)
            cycle.apply(v, w)
            z[rows] = w.array_r

    def _solve_schur(self, right: Any, left: Any) -> None:
        """S^-1 times a pressure, without constants in a closed domain; overwrites the right-hand side."""
        (v, w), work = self._velocity, self._pressure[2]
        if self._commutes:
            self._inverses[0].apply(right, left)
            right.set(0.0)
            for momentum, gradient, divergence, scale in zip(
                self._momentum, self._gradient, self._divergence, self._scales, strict=True
            ):
                gradient.mult(left, v)
                v.pointwiseMult(v, scale)
                momentum.mult(v, w)
                w.pointwiseMult(w, scale)
                divergence.multAdd(w, right, right)
        self._constants.remove(right)
        left.set(0.0)
        for inverse in self._inverses:
            inverse.apply(right, work)
            left.axpy(1.0, work)
        self._constants.remove(left)

    def destroy(self, _: Any = None) -> None:
        super().destroy()


def of_mass(equations: Equations) -> dict[str, Any]:
    """Options of four Chebyshev steps, bounds of eigenvalues being those of a straight cell (Wathen 1987)."""
    space, order = equations.space, equations.space.order - 1
    points, weights = basix.make_quadrature(CELLS[space.gdim], 2 * order)
    values = compat.tabulate(space.pressure, points)
    mass = (values.T * weights) @ values
    low, *_, high = np.linalg.eigvalsh(mass / np.sqrt(np.outer(mass.diagonal(), mass.diagonal())))
    return CHEBYSHEV | {"ksp_ksp_chebyshev_eigenvalues": f"{low},{high}"}


def _index_set(numbers: np.ndarray, comm: Any) -> Any:
    return PETSc.IS().createGeneral(numbers.astype(PETSc.IntType), comm=comm)


def _of_pressure(equations: Equations) -> dict[str, Any]:
    """Compiled forms of M, in flow with viscosity but the commutator's, and A, in unsteady flow."""
    space, where, forms = equations.space.pressure, equations.reference_map, {}
    p, q, measure = ufl.TrialFunction(space), ufl.TestFunction(space), equations.measure()
    if equations.kind in ("creeping", "unsteady"):
        mass = preconditioning.pressure_mass(p, q, equations.viscosity, where)
        forms["mass"] = compat.form(mass * measure)
    if equations.rate is not None:
        added = 0 if equations.surface is None else equations.surface.of_pressure(p, q)
        laplacian = preconditioning.pressure_laplacian(p, q, where)
        forms["laplacian"] = compat.form(laplacian * measure + added)
    return forms


def _interpolations(equations: Equations) -> list[Any]:
    """Interpolation (ascending rows of a component, vertices), identity at constrained ones. Collective."""
    fine, rows = component_rows(equations.space)
    coarse = compat.space(fine.mesh, ("Lagrange", 1))
    whole = compat.interpolation_matrix(coarse, fine)
    (owned, owned_below), comm = whole.getLocalSize(), whole.comm
    start, start_below = whole.getOwnershipRange()[0], whole.getOwnershipRangeColumn()[0]
    columns = PETSc.IS().createStride(owned_below, start_below, 1, comm=comm)
    vertices, nodes = compat.cell_dofs(coarse), compat.cell_dofs(fine)
    at_vertices = np.empty(vertices.max(initial=-1) + 1, dtype=np.int64)
    at_vertices[vertices] = nodes[:, : vertices.shape[1]]
    interpolations = []
    for mine, held in zip(rows, equations.held()[rows], strict=True):
        order = np.argsort(mine[:owned])
        ascending = PETSc.IS().createGeneral((start + order).astype(PETSc.IntType), comm=comm)
        one = whole.createSubMatrix(ascending, columns)
        free, free_below = one.createVecLeft(), one.createVecRight()
        free.setArray(~held[order])
        free_below.setArray(~held[at_vertices[:owned_below]])
        one.diagonalScale(free, free_below)
        places = start + np.argsort(order)
        for vertex in np.flatnonzero(held[at_vertices[:owned_below]]):
            one.setValue(places[at_vertices[vertex]], start_below + vertex, 1.0)
        one.assemble()
        interpolations.append(one)
        for lent in (ascending, free, free_below):
            lent.destroy()
    for lent in (whole, columns):
        lent.destroy()
    return interpolations
