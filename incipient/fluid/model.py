"""The terms of the flow and their discretisation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from ..arrays import Floats
from ..forms import ReferenceMap
from ..geometry.placement import Placement


@dataclass(frozen=True)
class Driven:
    """Base flow times a factor of time, driven by a force per unit mass.

    `velocity`: base flow at unit factor (UFL). `displaced`: load (2, 3) about a grain's centroid on
    the fluid it displaces per unit rate of the factor, of its placement.
    """

    velocity: Callable[[Any], Any]
    factor: Callable[[float], float]
    displaced: Callable[[Placement], Floats] | None = None


@dataclass(frozen=True)
class FlowModel:
    """The terms of the flow and their discretisation.

    order:         of the velocity; the pressure has one less
    inertia:       False omits convection (Stokes)
    convection:    "implicit" (Newton), or "extrapolated" (linear, Childs & Reddy's 2 v(n) - v(n-1))
    body_force:    per unit mass, of position and time (UFL), without gravity
    reference_map: map of a fixed reference domain; None: renewed at each step
    stabilisation: of convection on coarse cells (`forms.terms.grad_div`)
    upwind:        streamline upwinding (`forms.terms.streamline_upwind`), which `Block` needs
    solver:        a name in `solvers.SOLVERS`, or "two-level"
    viscosity:     kinematic (UFL); None: 1/Re
    shear_velocity: from k (UFL), for walls with friction
    mirrored:      the flow is its own mirror image in a plane of constant y
    """

    order: int = 2
    inertia: bool = True
    unsteady: bool = False
    convection: str = "implicit"
    body_force: Callable[[Any, Any], Any] | None = None
    driven: Driven | None = None
    reference_map: ReferenceMap | None = None
    moving_mesh: bool = False
    stabilisation: bool = False
    upwind: bool = False
    solver: str = "direct"
    viscosity: Callable[[Any], Any] | None = None
    shear_velocity: Any = None
    mirrored: bool = False

    @property
    def linear(self) -> bool:
        return not self.inertia or (self.unsteady and self.convection == "extrapolated")

    @property
    def polynomial(self) -> bool:
        stay = self.reference_map is None
        forced = self.body_force is not None or self.driven is not None
        return stay and not self.stabilisation and not forced and self.viscosity is None
