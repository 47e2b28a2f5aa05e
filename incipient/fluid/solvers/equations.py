"""What the flow's Jacobian is made of, for solvers that make operators of their own from it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ...forms import ReferenceMap
from ..space import TaylorHood, cell_size

if TYPE_CHECKING:
    from ..surface import SurfaceLoad


@dataclass(frozen=True)
class Equations:
    """The parts of the Jacobian [[F, B^T], [B, 0]], as UFL expressions that follow the state.

    space:         of velocity and pressure
    dirichlet:     the conditions that hold, of dolfinx
    open:          local pressure nodes where fluid leaves freely; none at all: known up to a constant
    viscosity:     kinematic; None: no stresses, as in the projection onto velocities free of divergence
    reference_map: of the flow
    rate:          coefficient a0 of the velocity in its rate of change, a constant of dolfinx; None: steady
    carrier:       velocity that convects, less that of the mesh; None: nothing convects
    size:          of cells over the order of the elements that upwinding is that of; None: that of the space
    surface:       what a free surface adds; None: there is none
    varying:       whether the viscosity varies in 3-D, and walls resist the flow along them by a law
    level:         whether all these walls are, as in channels whose cells are much longer than high
    thin:          whether these walls are resolved by thin cells instead
    convected:     whether blocks of preconditioners hold convection in time, too
    """

    space: TaylorHood
    dirichlet: Sequence[Any]
    open: np.ndarray
    viscosity: Any
    reference_map: ReferenceMap
    rate: Any = None
    carrier: Any = None
    size: Any = None
    surface: SurfaceLoad | None = None
    varying: bool = False
    level: bool = False
    thin: bool = False
    convected: bool = False

    def held(self) -> np.ndarray:
        """(local unknowns of the mixed space,) whether a condition holds there."""
        index_map = self.space.mixed.dofmap.index_map
        found = np.zeros(index_map.size_local + index_map.num_ghosts, dtype=bool)
        for condition in self.dirichlet:
            found[condition.dof_indices()[0]] = True
        return found

    def owned_held(self) -> np.ndarray:
        """(owned unknowns of the mixed space,) whether a condition holds there."""
        return self.held()[: self.space.mixed.dofmap.index_map.size_local]

    @property
    def block_carrier(self) -> Any:
        """The velocity that convects in operators that stand for blocks of the Jacobian in preconditioners.

        None in time unless `convected`: where the rate or viscosity outweighs convection, operators without it are
        symmetric, are smoothed in half the time and serve while steps have the same length
        (docs/contribute/defaults.md).
        """
        return self.carrier if self.rate is None or self.convected else None

    @property
    def upwind_size(self) -> Any:
        """Size of cells over the order of the elements that upwinding is that of."""
        return (
            cell_size(self.space.mixed.mesh) / self.space.order if self.size is None else self.size
        )

    @property
    def closed(self) -> bool:
        """Whether neither fluid leaves freely nor a surface is free: pressure is known up to a constant. Collective."""
        return self.surface is None and self.space.mixed.mesh.comm.allreduce(len(self.open)) == 0
