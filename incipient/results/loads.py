"""Forces and torques on a grain, their coefficients, and the gap of the computation, as data."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from ..arrays import Floats
from .quantity import AXES, load_words


@dataclass(frozen=True)
class Forces:
    """Forces on the grain (3,), scene units with fluid density one.

    flow: of the flow, without buoyancy; corrected for errors of known sign
    surface_integral: integral of sigma n over the surface, as a cross-check of the computed force
    buoyancy: of the hydrostatic pressure, exact
    computed: of the flow by the residual method, uncorrected; None: `flow` is uncorrected
    """

    flow: Floats
    surface_integral: Floats
    buoyancy: Floats
    weight: Floats
    computed: Floats | None = None

    @property
    def plain(self) -> Floats:
        """The force of the flow as computed (3,)."""
        return self.flow if self.computed is None else self.computed

    def corrected(self, change: Floats) -> Forces:
        """The forces with a change (3,) added to the computed force of the flow."""
        return replace(self, flow=self.plain + change, computed=self.plain)

    @property
    def total(self) -> Floats:
        """Flow, buoyancy and weight together, the paper's F_flow&g (9)."""
        return self.flow + self.buoyancy + self.weight

    def to_dict(self) -> dict[str, Any]:
        """Plain data for result.json."""
        return asdict(self) | {"total": self.total, "computed": self.plain}


@dataclass(frozen=True)
class Torques:
    """Torques on the grain (3,) about a point (3,), named as the forces; in 2-D along the third axis."""

    flow: Floats
    surface_integral: Floats
    about: Floats
    computed: Floats | None = None

    @property
    def plain(self) -> Floats:
        """The torque of the flow as computed (3,)."""
        return self.flow if self.computed is None else self.computed

    def corrected(self, change: Floats) -> Torques:
        """The torques with a change (3,) added to the computed torque of the flow."""
        return replace(self, flow=self.plain + change, computed=self.plain)

    def to_dict(self) -> dict[str, Any]:
        """Plain data for result.json."""
        return asdict(self) | {"computed": self.plain}


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

    closed: the grain touches the bed, and interstices narrower than the width are closed
    """

    width: float
    cells: int
    closed: bool = False

    @property
    def resolved(self) -> bool:
        """Whether at least two cells span the gap."""
        return self.closed or self.cells >= 2

    def to_dict(self) -> dict[str, Any]:
        """Plain data for result.json."""
        return asdict(self) | {"resolved": self.resolved}

    def line(self) -> str:
        """The gap as a line of text."""
        if self.closed:
            return f"gap                 closed where it is narrower than {self.width:.4g}"
        refine = "NOT resolved: refine with a smaller numerics.mesh_size"
        state = "resolved" if self.resolved else refine
        return f"gap                 {self.width:.4g}, {self.cells} cells across: {state}"


def apart(load: Floats) -> tuple[Floats, Floats]:
    """Force (3,) and torque (3,) of a load on a body: (3,) in 2-D, (6,) in 3-D."""
    if len(load) == 3:
        return np.array([load[0], load[1], 0.0]), np.array([0.0, 0.0, load[2]])
    return load[:3], load[3:]


def named(name: str, vector: Floats, gdim: int) -> dict[str, float]:
    """The components of a force (3,) by column: force_x, force_y, in 3-D also force_z."""
    return {f"{name}_{axis}": float(vector[place]) for place, axis in enumerate(AXES[:gdim])}


def named_torque(name: str, vector: Floats, gdim: int) -> dict[str, float]:
    """The components of a torque (3,) by column: one in 2-D, three in 3-D."""
    return {name: float(vector[2])} if gdim == 2 else named(name, vector, 3)


def loads_words(force: Floats, torque: Floats, gdim: int, digits: str = ".6g") -> str:
    """Force and torque (3,) as text."""
    turning = load_words(torque, "torque", gdim, digits)
    return f"{load_words(force, 'force', gdim, digits)}   torque {turning}"
