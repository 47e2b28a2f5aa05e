"""Meshes moved at random or as a function of time says, and the energy of what flows on them."""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations
from typing import Any

import dolfinx
import numpy as np
import ufl
from energy_stable import volume_before
from numpy.typing import NDArray

from incipient import compat
from incipient.arrays import Floats
from incipient.fluid import Fluid
from incipient.fluid.newton import NewtonReport
from incipient.fluid.transient import Interface, TimeStep


class RandomMotion:
    """Places of the nodes of a unit box's mesh, each thrown anew within a radius of where it was made.

    Args:
        mesh: as made; triangles or tetrahedra, straight or quadratic.
        radius: of the vertices' throws. Half the smallest width of a cell is the limit, beyond which cells can
            fold: 0.354 of the spacing for right-angled triangles, 0.288 for the six tetrahedra of a cube.
        bend: radius of the throws of mid-side nodes away from the middle.
        boundary: "slides" along the straight sides, or is thrown as "free"ly as the rest.
    """

    def __init__(
        self, mesh: Any, radius: float, bend: float = 0.0, boundary: str = "slides", seed: int = 1
    ):
        self.made: Floats = mesh.geometry.x.copy()
        self._gdim, self._radius, self._bend = mesh.geometry.dim, radius, bend
        self._random = np.random.default_rng(seed)
        # Throws go by the places of the nodes, so that they do not depend on how nodes are numbered.
        self._rank = np.argsort(np.lexsort(np.round(self.made, 9).T))
        self._sides = _mid_sides(compat.geometry_dofs(mesh), self._gdim)
        on_side = np.isclose(self.made[:, : self._gdim], 0.0) | np.isclose(
            self.made[:, : self._gdim], 1.0
        )
        self._may_move = ~on_side if boundary == "slides" else np.ones_like(on_side)

    def places(self) -> Floats:
        """(n, 3) places of the next throw."""
        middles, *ends = self._sides.T
        moved = self._throws(self._radius)
        moved[middles] = sum(moved[end] for end in ends) / 2 + self._throws(self._bend)[middles]
        places = self.made.copy()
        places[:, : self._gdim] += moved
        return places

    def _throws(self, radius: float) -> Floats:
        directions = self._random.standard_normal((len(self.made), self._gdim))
        lengths = self._random.random((len(self.made), 1)) ** (1 / self._gdim)
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        return radius * (lengths * directions)[self._rank] * self._may_move


def _mid_sides(cells: NDArray[np.int32], gdim: int) -> NDArray[np.int32]:
    """(n, 3) mid-side nodes of quadratic cells and the two vertices that each lies between."""
    # Sides are numbered from the last pair of vertices to the first.
    pairs = list(combinations(range(gdim + 1), 2))[::-1] if cells.shape[1] > gdim + 1 else []
    sides = [cells[:, [gdim + 1 + side, *ends]] for side, ends in enumerate(pairs)]
    return np.unique(np.vstack([np.empty((0, 3), np.int32), *sides]), axis=0)


class Swaying(Interface):
    """A mesh that is where a function of time says, as what moves in a flow (`fluid.transient.Interface`)."""

    def __init__(self, fluid: Fluid, places_at: Callable[[float], Floats]):
        super().__init__(fluid)
        self._at, self._x = places_at, fluid.domain.mesh.geometry.x
        self._past = [self._x.copy()]

    def attempt(
        self, length: float, order: int, tolerance: float, before: NewtonReport | None = None
    ) -> NewtonReport:
        """Move the mesh, and solve for the flow."""
        self.fluid.move_mesh(self._at(self.fluid.time), self._past[0], self._past[-1])
        # Factors of the mesh before contract slowly where it jumps.
        return self.fluid.solve(tolerance, max_iterations=50)

    def accept(self, step: TimeStep) -> None:
        """Keep the mesh as it is."""
        self._past = [self._x.copy(), self._past[0]]

    def restore(self) -> None:
        """Put the mesh back."""
        self._x[:] = self._past[0]


class Energy:
    """Kinetic energy of a fluid's state on the mesh as it is, and what the last step of first order spent."""

    def __init__(self, fluid: Fluid):
        v, before = (ufl.split(f)[0] for f in (fluid.state, fluid.history[0]))
        dx = fluid.space.quadrature()
        volume = volume_before(fluid._shifts[0])
        strain = ufl.sym(ufl.grad(v))
        self._kinetic = compat.form(ufl.inner(v, v) / 2 * dx)
        self._dissipation = compat.form(2 * fluid.viscosity * ufl.inner(strain, strain) * dx)
        self._increment = compat.form(volume / 2 * ufl.inner(v - before, v - before) * dx)

    def kinetic(self) -> float:
        """Integral of |v|^2 / 2 over the mesh."""
        return _value(self._kinetic)

    def spent(self, length: float) -> float:
        """Viscous dissipation in a step of a length, and the energy of the increment on the mesh before it."""
        return length * _value(self._dissipation) + _value(self._increment)


def _value(form: Any) -> float:
    return float(dolfinx.fem.assemble_scalar(form))
