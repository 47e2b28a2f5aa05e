"""What the flow's Jacobian is made of, for solvers that make operators of their own from it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...forms import ReferenceMap
from ..space import TaylorHood


@dataclass(frozen=True)
class Equations:
    """The parts of the Jacobian [[F, B^T], [B, 0]], as UFL expressions that follow the state.

    space:         of velocity and pressure
    dirichlet:     the conditions that hold, of dolfinx
    closed:        whether the pressure is known up to a constant only
    viscosity:     kinematic
    rate:          coefficient a0 of the velocity in its rate of change; None: steady
    carrier:       velocity that convects, less that of the mesh; None: nothing convects
    reference_map: None for the identity
    """

    space: TaylorHood
    dirichlet: Sequence[Any]
    closed: bool
    viscosity: Any
    rate: Any = None
    carrier: Any = None
    reference_map: ReferenceMap | None = None

    def held(self) -> np.ndarray:
        """(local unknowns of the mixed space,) whether a condition holds there."""
        index_map = self.space.mixed.dofmap.index_map
        found = np.zeros(index_map.size_local + index_map.num_ghosts, dtype=bool)
        for condition in self.dirichlet:
            found[condition.dof_indices()[0]] = True
        return found
