"""How often a run does what takes time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any


@dataclass(frozen=True)
class Counts:
    """Time steps, Newton corrections, factorisations, Krylov iterations, new meshes after the first."""

    steps: int = 0
    newton: int = 0
    factorisations: int = 0
    krylov: int = 0
    remeshings: int = 0

    @classmethod
    def of(cls, data: Mapping[str, Any]) -> Counts:
        """From numbers by name; what is missing is none, other names do not matter."""
        return cls(**{name: int(data.get(name, 0)) for name in COUNTS})


COUNTS = tuple(field.name for field in fields(Counts))
NOTHING = Counts()
