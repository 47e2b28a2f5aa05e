"""Forces and torques on a grain, their coefficients, and the gap they were computed with, as data."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np


@dataclass(frozen=True)
class Forces:
    """Forces on the grain (3,), scene units with fluid density one."""

    flow: (
        np.ndarray
    )  # force of the flow, without buoyancy: as computed, corrected where its errors are known
    # Computed force of the flow by integrating sigma n over the surface (cross-check)
    surface_integral: np.ndarray
    buoyancy: np.ndarray  # force of the hydrostatic pressure, exact
    weight: np.ndarray  # weight of the grain
    # Force of the flow by the residual method, without corrections; None: `flow` is not corrected
    computed: np.ndarray | None = None

    @property
    def plain(self) -> np.ndarray:
        """The force of the flow as computed (3,)."""
        return self.flow if self.computed is None else self.computed

    def corrected(self, change: np.ndarray) -> Forces:
        """The forces with a change (3,) added to the computed force of the flow."""
        return replace(self, flow=self.plain + change, computed=self.plain)

    @property
    def total(self) -> np.ndarray:
        """Flow, buoyancy and weight together, the paper's F_flow&g (9)."""
        return self.flow + self.buoyancy + self.weight


@dataclass(frozen=True)
class Couples:
    """Torques on the grain (3,) about its centre of mass, as the forces of these names; in 2-D along the third axis."""

    flow: np.ndarray
    surface_integral: np.ndarray
    about: np.ndarray
    computed: np.ndarray | None = None

    @property
    def plain(self) -> np.ndarray:
        """The torque of the flow as computed (3,)."""
        return self.flow if self.computed is None else self.computed

    def corrected(self, change: np.ndarray) -> Couples:
        """The torques with a change (3,) added to the computed torque of the flow."""
        return replace(self, flow=self.plain + change, computed=self.plain)


@dataclass(frozen=True)
class Coefficients:
    """Drag, lift and moment over V^2 A/2 and V^2 A L/2, with the V of the Reynolds number, L the grain's size.

    A is L in 2-D (per unit depth) and pi L^2/4 in 3-D, where the moment is that about the y axis.
    """

    drag: float
    lift: float
    moment: float
    reference_velocity: float
    reference_length: float


@dataclass(frozen=True)
class Gap:
    """The gap between grain and bed in the computed flow.

    resolved: at least two cells lie across it, so that the flow in it is computed and not guessed; closed, one
    """

    width: float
    cells: int
    # The grain touches the bed, and the space next to contacts is closed where it is narrower than the width
    closed: bool = False

    @property
    def resolved(self) -> bool:
        """Whether enough cells lie across the gap."""
        return self.closed or self.cells >= 2

    def line(self) -> str:
        """What the gap is, for a reader."""
        if self.closed:
            return f"gap                 closed where it is narrower than {self.width:.4g}"
        state = (
            "resolved"
            if self.resolved
            else "NOT resolved: refine with a smaller numerics.mesh_size"
        )
        return f"gap                 {self.width:.4g}, {self.cells} cells across: {state}"


def apart(load: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Force (3,) and torque (3,) of a load on a body: (3,) in 2-D, (6,) in 3-D."""
    if len(load) == 3:
        return np.array([load[0], load[1], 0.0]), np.array([0.0, 0.0, load[2]])
    return load[:3], load[3:]


def named(name: str, vector: np.ndarray, gdim: int) -> dict[str, float]:
    """The components (3,) of a force by the names of columns: force_x, force_y, in 3-D force_z as well."""
    return {f"{name}_{axis}": float(vector[place]) for place, axis in enumerate("xyz"[:gdim])}


def named_couple(name: str, vector: np.ndarray, gdim: int) -> dict[str, float]:
    """The components (3,) of a torque by the names of columns: one in 2-D, three in 3-D."""
    return {name: float(vector[2])} if gdim == 2 else named(name, vector, 3)


def force_words(vector: np.ndarray, gdim: int, digits: str = ".6g") -> str:
    """A force (3,) for a reader: (x, y), in 3-D (x, y, z)."""
    return f"({', '.join(format(float(one), digits) for one in vector[:gdim])})"


def couple_words(vector: np.ndarray, gdim: int, digits: str = ".6g") -> str:
    """A torque (3,) for a reader: a number in 2-D, (x, y, z) in 3-D."""
    return format(float(vector[2]), digits) if gdim == 2 else force_words(vector, 3, digits)


def loads_words(force: np.ndarray, couple: np.ndarray, gdim: int, digits: str = ".6g") -> str:
    """Force and torque (3,) for a reader."""
    return f"{force_words(force, gdim, digits)}   torque {couple_words(couple, gdim, digits)}"
