"""The flow's Jacobian without a matrix: what it does to a change of the state, assembled as a vector each time."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import dolfinx
import numpy as np
import ufl
from petsc4py import PETSc

from .. import compat
from ..compat import petsc


class Action:
    """Applies the Jacobian of the present state, or its transpose; where conditions hold that of the identity.

    In elements of order three and more on tetrahedra one application costs about three times that of a matrix, which
    takes twenty to make and 1.5 kB an unknown to keep. Methods are collective.

    Args:
        state: function of the mixed space that the residual is of.
        residual: its residual as a UFL form, tested with velocity and pressure.
        held: (owned unknowns,) where conditions hold.
    """

    def __init__(self, state: Any, residual: Callable[[Any, Any], Any], held: np.ndarray):
        self._state, self._residual, self._held = state, residual, held
        self._direction = dolfinx.fem.Function(state.function_space)
        self._forms: dict[bool, Any] = {}
        self._vector: Any = None

    def times(self, values: np.ndarray, transposed: bool = False) -> np.ndarray:
        """(owned unknowns,) the product with a vector (owned unknowns,)."""
        form = self._form(transposed)
        owned = len(values)
        self._direction.x.array[:owned] = np.where(self._held, 0.0, values)
        self._direction.x.scatter_forward()
        if self._vector is None:
            self._vector = compat.create_vector(form, self._state.function_space)
        with self._vector.localForm() as local:
            local.set(0.0)
        petsc.assemble_vector(self._vector, form)
        self._vector.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
        return np.where(self._held, values, self._vector.array_r)

    def _form(self, transposed: bool) -> Any:
        if transposed not in self._forms:
            tests = ufl.TestFunction(self._state.function_space)
            tested, change = (self._direction, tests) if transposed else (tests, self._direction)
            residual = self._residual(*ufl.split(tested))
            self._forms[transposed] = compat.form(ufl.derivative(residual, self._state, change))
        return self._forms[transposed]

    def destroy(self) -> None:
        """Free PETSc's memory."""
        if self._vector is not None:
            self._vector.destroy()
