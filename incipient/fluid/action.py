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
from .space import TaylorHood


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


class PressureForce:
    """Applies the part of the Jacobian by which pressures act on momentum, or the transpose of continuity's part.

    The latter is the former without upwinding. It is a matrix, since a smoother needs it at each step: of 430 actions
    for two corrections and two dual solutions of a sphere in shear (30,000 unknowns in order two) it spares 198.
    Methods are collective.

    Args:
        space: of velocity and pressure.
        form: the bilinear form of both spaces (test function: velocity), with upwinding or without.
    """

    def __init__(self, space: TaylorHood, form: Callable[[bool], Any]):
        self._form = form
        velocities = space.velocity.dofmap.index_map.size_local * space.gdim
        pressures = space.pressure.dofmap.index_map.size_local
        self._velocities, self._pressures = (
            space.velocity_map[:velocities],
            space.pressure_map[:pressures],
        )
        self._made: dict[
            bool, tuple[Any, Any, Any, Any]
        ] = {}  # form, matrix and vectors, by whether transposed
        self._fresh: set[bool] = set()

    def renew(self) -> None:
        """Take the state as it is for what is applied from now on. Not collective."""
        self._fresh = set()

    def times(self, values: np.ndarray, transposed: bool = False) -> np.ndarray:
        """(owned unknowns,) the forces of the pressures among the values (owned unknowns,); zero for pressures."""
        if transposed not in self._made:
            form = compat.form(self._form(not transposed))
            matrix = petsc.create_matrix(form)
            self._made[transposed] = form, matrix, *matrix.createVecs()
        form, matrix, right, left = self._made[transposed]
        if transposed not in self._fresh:
            matrix.zeroEntries()
            petsc.assemble_matrix(matrix, form)
            matrix.assemble()
            self._fresh.add(transposed)
        right.setArray(values[self._pressures])
        matrix.mult(right, left)
        found = np.zeros_like(values)
        found[self._velocities] = left.array_r
        return found

    def destroy(self) -> None:
        """Free PETSc's memory."""
        for _, *held in self._made.values():
            for one in held:
                one.destroy()
