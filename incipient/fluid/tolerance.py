"""How well the algebraic equations of a time step are solved: no better than the step itself can use."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

LEAST = 1e-9  # of a time step


@dataclass(frozen=True)
class ShareOfError:
    """The tolerance of a time step as a share of the local error in time that the step before has made.

    share:       what the algebra may add to the error of a step
    unknown:     tolerance while no step has an error estimate yet
    least, most: between which the tolerance stays
    """

    share: float = 0.1
    unknown: float = 1e-6
    least: float = LEAST
    most: float = 1e-4

    def after(self, error: float | None) -> float:
        """The tolerance of a step after one of this local error, which None leaves open. Not collective."""
        if error is None:
            return self.unknown
        return float(np.clip(self.share * error, self.least, self.most))


def of_steps(asked: float | Literal["auto"]) -> float | ShareOfError:
    """The tolerance of time steps, from `numerics.tolerance`. Not collective."""
    return ShareOfError() if asked == "auto" else max(asked, LEAST)
