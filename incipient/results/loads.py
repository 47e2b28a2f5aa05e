"""Forces and couples on a grain, their coefficients, and the gap they were computed with, as data."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class Forces:
    """Forces on the grain (3,), scene units with fluid density one.

    flow:             force of the flow, by the residual method; without buoyancy
    surface_integral: force of the flow by integrating sigma n over the surface (cross-check)
    buoyancy:         force of the hydrostatic pressure, exact
    weight:           weight of the grain
    repulsion:        from what a grain that is repelled has come close to; zero for others
    """

    flow: np.ndarray
    surface_integral: np.ndarray
    buoyancy: np.ndarray
    weight: np.ndarray
    repulsion: np.ndarray = field(default_factory=lambda: np.zeros(3))

    @property
    def total(self) -> np.ndarray:
        """Flow, buoyancy and weight together, the paper's F_flow&g (9), and what repels the grain."""
        return self.flow + self.buoyancy + self.weight + self.repulsion


@dataclass(frozen=True)
class Couples:
    """Couples on the grain (3,) about its centre of mass, as the forces of these names; in 2D along the third axis."""

    flow: np.ndarray
    surface_integral: np.ndarray
    about: np.ndarray
    repulsion: np.ndarray = field(default_factory=lambda: np.zeros(3))


@dataclass(frozen=True)
class Coefficients:
    """Drag, lift and moment over V^2 L/2 and V^2 L^2/2, with V and L of the Reynolds number but L the grain's size."""

    drag: float
    lift: float
    moment: float
    reference_velocity: float
    reference_length: float


@dataclass(frozen=True)
class Gap:
    """The gap between grain and bed in the computed flow.

    resolved: at least two cells lie across it, so that the flow in it is computed and not guessed
    """

    width: float
    cells: int

    @property
    def resolved(self) -> bool:
        """Whether at least two cells lie across the gap."""
        return self.cells >= 2
