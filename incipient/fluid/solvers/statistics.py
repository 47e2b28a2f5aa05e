"""What a linear solver has done so far."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass
class LinearStatistics:
    """Counts of what a linear solver has done so far."""

    factorisations: int = 0
    solves: int = 0
    krylov_iterations: int = 0

    def add(self, other: LinearStatistics) -> None:
        """Count what another solver has done as well."""
        self.factorisations += other.factorisations
        self.solves += other.solves
        self.krylov_iterations += other.krylov_iterations
