"""How well the algebraic equations of a time step are solved: no better than the step itself can use."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

# What steady iterations may leave where nothing is known of the error: Newton's method then has left far less.
STEADY = 1e-6
BY_TWO_LEVELS = (
    1e-5  # the same where each of Newton's corrections is a rough one, and loads err far more by the cells
)
LEAST = 1e-9  # of a time step


@dataclass(frozen=True)
class ShareOfError:
    """The tolerance of a time step as a share of the local error in time that the step before has made.

    share:       what the algebra may add to the error of a step
    unknown:     tolerance while no step has told its error yet
    least, most: between which the tolerance stays
    """

    share: float = 0.1
    unknown: float = 1e-6
    least: float = LEAST
    most: float = 1e-4

    def after(self, error: float | None) -> float:
        """The tolerance of a step after one of this local error; None: it could not be told. Not collective."""
        if error is None:
            return self.unknown
        return float(np.clip(self.share * error, self.least, self.most))


def of_steady(asked: float | Literal["auto"], two_levels: bool = False) -> float:
    """The tolerance of a steady flow, from `numerics.tolerance`; by two levels it may be larger. Not collective."""
    if asked != "auto":
        return asked
    return BY_TWO_LEVELS if two_levels else STEADY


def of_steps(asked: float | Literal["auto"]) -> float | ShareOfError:
    """The tolerance of time steps, from `numerics.tolerance`. Not collective."""
    return ShareOfError() if asked == "auto" else max(asked, LEAST)
