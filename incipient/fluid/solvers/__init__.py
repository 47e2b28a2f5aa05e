"""Linear solvers of the flow, by name."""

from __future__ import annotations

from collections.abc import Mapping

from .block import Block
from .direct import Direct
from .equations import Equations, LinearSolver
from .two_level import TwoLevel

__all__ = [
    "SOLVERS",
    "Block",
    "Direct",
    "Equations",
    "LinearSolver",
    "TwoLevel",
]


SOLVERS: Mapping[str, type[Direct | Block]] = {
    "direct": Direct,
    "block": Block,
}
