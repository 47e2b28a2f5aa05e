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
    """A base flow times a factor of time, driven by a force per unit mass: its rate of change.

    velocity:  function of position (UFL) giving the base flow at factor one
    factor:    function of time
    displaced: function of a grain's placement giving the load (2, 3), force and torque about its centroid, on the
               fluid that it displaces at unit rate of the factor; None without a grain
    """

    velocity: Callable[[Any], Any]
    factor: Callable[[float], float]
    displaced: Callable[[Placement], Floats] | None = None


@dataclass(frozen=True)
class FlowModel:
    """The terms of the flow and their discretisation.

    order:         order of the velocity; the pressure has one less
    inertia:       False omits convection (Stokes)
    unsteady:      whether there is a time derivative
    convection:    "implicit" (Newton), or "extrapolated" (linear, Childs & Reddy's 2 v(n) - v(n-1))
    body_force:    function of position and time (UFL) giving a force per unit mass, or None; without gravity,
                   since a potential force only shifts the pressure
    driven:        an unsteady base flow, and its driving force; None: there is none
    reference_map: map of a reference domain that stays; None: the reference is renewed at each step
    moving_mesh:   whether the mesh itself is moved between steps (`Fluid.mesh_moved`), straight cells staying
                   straight; its reference is renewed
    stabilisation: whether convection is stabilised on cells too coarse for it (`forms.terms.grad_div`)
    upwind:        whether the stabilisation is streamline upwinding (`forms.terms.streamline_upwind`), as `Block` needs
    exact:         whether upwinding is in the Jacobian alone, not in the residual
    upwind_order:  order of the elements in the upwinding; 0: that of the flow
    solver:        method for the linear systems, a name in `solvers.SOLVERS`, or "two-level" (`flow.build_fluid`)
    viscosity:     function of 1/Re (UFL) giving the kinematic viscosity, or None: it is 1/Re
    shear_velocity: friction velocity by k (UFL), for walls with a law of friction; None without a model of k
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
    exact: bool = False
    upwind_order: int = 0
    solver: str = "direct"
    viscosity: Callable[[Any], Any] | None = None
    shear_velocity: Any = None

    @property
    def linear(self) -> bool:
        """Whether one linear solve is the whole solution."""
        return not self.inertia or (self.unsteady and self.convection == "extrapolated")

    @property
    def polynomial(self) -> bool:
        """Whether what is integrated is a polynomial on cells that are straight, and stay so where the mesh moves."""
        stay = self.reference_map is None
        forced = self.body_force is not None or self.driven is not None
        return stay and not self.stabilisation and not forced and self.viscosity is None
