"""Default PETSc options."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from petsc4py import PETSc

FLUID = "fluid_"  # prefix of the whole system
# Additional workspace of MUMPS in percent, which it underestimates for saddle points with pivoting.
WORKSPACE = 200
GMRES = {
    "ksp_type": "gmres",
    "ksp_gmres_restart": 100,
    "ksp_initial_guess_nonzero": True,
    "ksp_converged_use_initial_residual_norm": True,
    "pc_type": "python",
}
# Chebyshev, Jacobi and incomplete LU without fill do not smooth convection.
RELAXATION = {
    "mg_levels_ksp_type": "richardson",
    "mg_levels_ksp_max_it": 1,
    "mg_levels_pc_type": "sor",
}
COMPONENT = {"pc_mg_galerkin": "pmat"} | RELAXATION
BOOMERAMG = {
    "pc_type": "hypre",
    "pc_hypre_type": "boomeramg",
    "pc_hypre_boomeramg_coarsen_type": "HMIS",
    "pc_hypre_boomeramg_interp_type": "ext+i",
    "pc_hypre_boomeramg_P_max": 4,
    "pc_hypre_boomeramg_strong_threshold": 0.5,
}
AGGREGATED = {"pc_type": "gamg", "pc_gamg_threshold": 0.01} | RELAXATION


CHEBYSHEV = {
    "pc_type": "ksp",
    "ksp_ksp_type": "chebyshev",
    "ksp_ksp_norm_type": "none",
    "ksp_ksp_max_it": 4,
    "ksp_pc_type": "jacobi",
}


@contextmanager
def defaults(prefix: str, chosen: Mapping[str, Any]) -> Iterator[None]:
    """Set default options of a prefix within the context; user options take precedence."""
    options = PETSc.Options(prefix)
    added = {name: value for name, value in chosen.items() if not options.hasName(name)}
    for name, value in added.items():
        options.setValue(name, value)
    try:
        yield
    finally:
        for name in added:
            options.delValue(name)


def algebraic(prefix: str = "") -> dict[str, Any]:
    """Options of algebraic multigrid: BoomerAMG, or GAMG without hypre."""
    chosen = BOOMERAMG if PETSc.Sys.hasExternalPackage("hypre") else AGGREGATED
    return {f"{prefix}{name}": value for name, value in chosen.items()}


def lu(prefix: str, more: Mapping[str, Any]) -> dict[str, Any]:
    """Options of an LU factorisation, by MUMPS where PETSc has it, with `more` of MUMPS's options."""
    chosen: dict[str, Any] = {"ksp_type": "preonly", "pc_type": "lu"}
    if PETSc.Sys.hasExternalPackage("mumps"):
        chosen |= {"pc_factor_mat_solver_type": "mumps", "mat_mumps_icntl_14": WORKSPACE, **more}
    return {f"{prefix}{name}": value for name, value in chosen.items()}


def krylov(matrix: Any, chosen: Mapping[str, Any], context: Any = None) -> Any:
    """Make PETSc's solver of the whole system with default options. Collective.

    `context`: of the preconditioner where its type is "python".
    """
    solver = PETSc.KSP().create(matrix.comm)
    solver.setOptionsPrefix(FLUID)
    solver.setOperators(matrix)
    with defaults(FLUID, chosen):
        solver.setFromOptions()
    if solver.getPC().getType() == "python":
        solver.getPC().setPythonContext(context)
    return solver


def preconditioner(
    matrix: Any, prefix: str, chosen: Mapping[str, Any], interpolation: Any = None
) -> Any:
    """Set up PETSc's preconditioner of a matrix with default options. Collective.

    `interpolation`: from the coarse unknowns, for two-level multigrid.
    """
    pc = PETSc.PC().create(matrix.comm)
    pc.setOptionsPrefix(prefix)
    pc.setOperators(matrix)
    if interpolation is not None:
        pc.setType("mg")
        pc.setMGLevels(2)
        pc.setMGInterpolation(1, interpolation)
    with defaults(prefix, chosen):
        pc.setFromOptions()
        pc.setUp()
    return pc
