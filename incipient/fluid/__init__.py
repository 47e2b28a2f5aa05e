"""The fluid sub-problem: spaces, boundary conditions, steady and unsteady (`transient`) flow."""

from __future__ import annotations

from .conditions import Carried, Condition, Open, Prescribed, Slip, no_slip
from .flow import Fluid
from .model import FlowModel
from .steady import solve_steady

__all__ = [
    "Carried",
    "Condition",
    "FlowModel",
    "Fluid",
    "Open",
    "Prescribed",
    "Slip",
    "no_slip",
    "solve_steady",
]
