"""Iterative solution of the linear systems of flow and turbulence."""

from __future__ import annotations

from typing import Any

import numpy as np
from petsc4py import PETSc

from ..fluid.solvers.options import defaults, lu
from ..installed import return_freed_memory
from ..parallel import Owner

TOGETHER = "turbulent_"
MOST_TOGETHER = 150
# Iterations up to which factors of the flow serve on; with older ones residuals tell little.
PATIENCE = 10
# Block low-rank factors (ICNTL(35)) and what they leave out of blocks (CNTL(7)): Amestoy, Buttari, L'Excellent & Mary
# (2019), ACM Trans. Math. Software 45, 2. With 78,000 unknowns past a sphere in its pocket they take 9.8 s instead of
# 31.7, an iteration more or less; with 0.05 they take 7.7 s and 24 iterations instead of 5.
LOW_RANK = {"mat_mumps_icntl_35": 2, "mat_mumps_cntl_7": 0.01}


class BlockByBlock(Owner):
    """GMRES for A x = b, A a nest of four blocks of flow and turbulence, with its lower triangle.

    The flow's approximate factorisation, reused up to 10 iterations, is applied first, then that of the turbulence's
    whole block: with one per quantity GMRES fails in long steps of k and epsilon. PETSc options with the prefixes
    ``turbulent_``, ``turbulent_fieldsplit_flow_`` and ``turbulent_fieldsplit_fields_`` take precedence. Methods are
    collective.
    """

    def __init__(self, nest: Any):
        super().__init__()
        self.matrix, self._aged = nest, True
        self._options = {
            "ksp_type": "gmres",
            "ksp_pc_side": "right",
            "ksp_gmres_restart": MOST_TOGETHER,
            "pc_fieldsplit_type": "multiplicative",
            **lu("fieldsplit_flow_", LOW_RANK),
            **lu("fieldsplit_fields_", {}),
        }
        self._solver = self.holding(PETSc.KSP().create(nest.comm))
        self._solver.setOptionsPrefix(TOGETHER)
        self._solver.setOperators(nest)
        self._blocks = self._solver.getPC()
        self._blocks.setType("fieldsplit")
        rows = zip(("flow", "fields"), nest.getNestISs()[0], strict=True)
        self._blocks.setFieldSplitIS(*rows)
        self._solver.setTolerances(atol=1e-50, max_it=MOST_TOGETHER)
        with defaults(TOGETHER, self._options):
            self._solver.setFromOptions()

    def prepare(self) -> None:
        """Take the present blocks of the matrix; the flow's factorisation may be of an earlier one."""
        self.matrix.assemble()
        with defaults(TOGETHER, self._options):
            self._solver.setUp()
            if self._aged:
                self._renew()
            self._blocks.getFieldSplitSubKSP()[1].setUp()

    def _renew(self) -> None:
        flow = self._blocks.getFieldSplitSubKSP()[0]
        factors, matrices = flow.getPC(), flow.getOperators()
        factors.setReusePreconditioner(False)
        factors.reset()
        return_freed_memory()
        flow.setOperators(*matrices)
        flow.setUp()
        factors.setReusePreconditioner(True)

    def balance(self, right: tuple[Any, Any]) -> float:
        """Scale the turbulence's rows of A to a right-hand side as large as the flow's; returns the factor.

        Next to walls the logarithms' residuals are larger by orders of magnitude.
        """
        of_flow, of_fields = (one.norm() for one in right)
        known = 0.0 < of_flow < np.inf and 0.0 < of_fields < np.inf
        factor = float(of_flow / of_fields) if known else 1.0
        for column in (0, 1):
            self.matrix.getNestSubMatrix(1, column).scale(factor)
        return factor

    def approximate(self, b: Any, x: Any, rtol: float) -> None:
        """Solve A x = b to a residual of `rtol` times b; x is not finite if it fails."""
        solver = self._solver
        solver.setTolerances(rtol=rtol, max_it=MOST_TOGETHER if self._aged else PATIENCE)
        solver.solve(b, x)
        if solver.getConvergedReason() <= 0 and not self._aged:
            with defaults(TOGETHER, self._options):
                self._renew()
            solver.setTolerances(max_it=MOST_TOGETHER)
            solver.solve(b, x)
        self._aged = solver.getConvergedReason() <= 0
        if self._aged:
            x.set(np.inf)
