"""The fluid sub-problem: spaces, boundary conditions, steady and time-dependent solution."""

from .conditions import Carried, Condition, Open, Prescribed, Slip, no_slip
from .flow import FlowModel, Fluid
from .steady import solve_steady
from .transient import Interface, TimeStep, Transient

__all__ = [
    "Carried",
    "Condition",
    "FlowModel",
    "Fluid",
    "Interface",
    "Open",
    "Prescribed",
    "Slip",
    "TimeStep",
    "Transient",
    "no_slip",
    "solve_steady",
]
