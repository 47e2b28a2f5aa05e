"""The list of all effects, which everything else walks."""

from __future__ import annotations

from ..planning.effects import Decision
from ..planning.flow_setup import Setup
from ..planning.numbers import Numbers
from ..planning.plan import Plan
from ..results.quantity import OutputQuantity
from .contact import ContactEffect
from .effect import Effect
from .flow import FlowEffect
from .free_surface import FreeSurfaceEffect
from .gravity import GravityEffect
from .inertia import InertiaEffect
from .moving_grain import FreeBodyEffect
from .moving_mesh import MovingMeshEffect
from .third_dimension import ThirdDimensionEffect
from .traction import TractionEffect
from .turbulence import TurbulenceEffect
from .unsteadiness import UnsteadinessEffect

# In the order in which plans and results show them; parts of a run are solved in this order, too.
EFFECTS: tuple[Effect, ...] = (
    InertiaEffect(),
    UnsteadinessEffect(),
    TractionEffect(),
    GravityEffect(),
    ContactEffect(),
    FlowEffect(),
    MovingMeshEffect(),
    FreeBodyEffect(),
    FreeSurfaceEffect(),
    TurbulenceEffect(),
    ThirdDimensionEffect(),
)


def decisions(setup: Setup, numbers: Numbers) -> tuple[Decision, ...]:
    """What is decided on every effect. Not collective."""
    return tuple(effect.decide(setup, numbers) for effect in EFFECTS)


def quantities(plan: Plan | None = None) -> tuple[OutputQuantity, ...]:
    """What runs may have to report, of those effects that a plan has, or of all. Not collective."""
    present = (effect for effect in EFFECTS if plan is None or plan.has(effect.name))
    return tuple(one for effect in present for one in effect.quantities)
