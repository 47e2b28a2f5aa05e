"""The fluid sub-problem: spaces, boundary conditions, steady and time-dependent solution."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from .conditions import Carried, Condition, Open, Prescribed, Seeping, Slip, no_slip
from .flow import Fluid
from .model import FlowModel
from .steady import solve_steady

if TYPE_CHECKING:
    from .quasisteady import QuasiSteady
    from .transient import Interface, TimeStep, Transient

__all__ = [
    "Carried",
    "Condition",
    "FlowModel",
    "Fluid",
    "Interface",
    "Open",
    "Prescribed",
    "QuasiSteady",
    "Seeping",
    "Slip",
    "TimeStep",
    "Transient",
    "no_slip",
    "solve_steady",
]


def __getattr__(name: str) -> Any:
    """What is for flow in time only is imported when it is asked for: a steady flow does without it."""
    if name in ("Interface", "TimeStep", "Transient"):
        from . import transient

        return getattr(transient, name)
    if name == "QuasiSteady":
        from .quasisteady import QuasiSteady

        return QuasiSteady
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
