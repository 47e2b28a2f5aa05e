"""Solution of the flow's linear systems, and the solvers of assembled matrices by name."""

from __future__ import annotations

from collections.abc import Mapping

from .block import Block, Triangle
from .direct import Direct
from .equations import Equations
from .solver import LinearSolver, LinearStatistics
from .two_level import TwoLevel

__all__ = [
    "SOLVERS",
    "Block",
    "Direct",
    "Equations",
    "LinearSolver",
    "LinearStatistics",
    "Triangle",
    "TwoLevel",
]


SOLVERS: Mapping[str, type[Direct | Block]] = {
    "direct": Direct,
    "block": Block,
}
