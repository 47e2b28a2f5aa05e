"""Newton's method, with the remaining error estimated from the contraction of the updates."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, Protocol

import numpy as np

from ..errors import UnsolvedError

WORST_CONTRACTION = 0.3
ROUGH = 1e-3  # relative residual of the linear systems of updates with a new Jacobian each
# Solves with one update by the same LU factorisation, before a second update measures the contraction again.
MEASURED_EVERY = 8
MUCH = 0.05  # relative change of the state that makes an older preconditioner useless


class System(Protocol):
    """Discretised problem for Newton's method; all methods are collective."""

    def correction(self, fresh: bool, rtol: float | None) -> float:
        """Subtract a Newton update, `fresh` with a new factorisation; returns its relative size.

        `rtol`: residual of the system with a new Jacobian; None: with that of the factorisation.
        """
        ...


@dataclass(frozen=True)
class Contraction:
    """Contraction of Newton updates with the present LU factorisation.

    ratio: of the second to the first update; measured, solves: numbers of its measurement and the latest solve.
    """

    ratio: float = np.inf
    measured: int = 0
    solves: int = 0

    def error_left(self, size: float) -> float:
        """Remaining error after a first update, if the ratio grows with the age of the factorisation."""
        if not self.measured or self.solves - self.measured >= MEASURED_EVERY:
            return np.inf
        ratio = self.ratio * (self.solves + 1) / self.measured
        return size * ratio / (1 - ratio) if ratio < 0.5 else np.inf

    def after(self, sizes: list[float]) -> Contraction:
        number = self.solves + 1
        if len(sizes) < 2 or sizes[0] == 0.0:
            return replace(self, solves=number)
        # The first two updates count; later ones are closer to round-off.
        return Contraction(sizes[1] / sizes[0], number, number)


@dataclass(frozen=True)
class NewtonReport:
    """Relative sizes of the Newton updates, the estimated remaining error, and `failure` of the next linear system.

    residuals: of the equations of motion of coupled parts, relative to their loads, in their iterations
    """

    converged: bool
    corrections: tuple[float, ...]
    error: float
    contraction: Contraction = Contraction()
    failure: str = ""
    residuals: tuple[float, ...] = ()

    @property
    def corrected(self) -> int:
        return max(len(self.residuals) - 1, 0)

    @property
    def iterations(self) -> int:
        return len(self.corrections)


def solve(
    system: System,
    tolerance: float,
    max_iterations: int,
    watch: Callable[[int, float], Any] = lambda iteration, size: None,
    fresh: bool = True,
    contraction: Contraction | None = None,
    inexact: bool = False,
) -> NewtonReport:
    """Iterate until the remaining error, about d r/(1 - r) with r = d/d_previous, is below `tolerance`. Collective.

    Jacobian and factorisation are renewed at the start if `fresh` and when an update exceeds
    `WORST_CONTRACTION` times the previous one. With the `contraction` of earlier solves a single
    update may suffice. With `inexact` every update has a new Jacobian, and the preconditioner is
    renewed after an update above `MUCH`.

    `converged=False`: updates have grown three times in a row by half or more, are not finite, or a
    linear system is not solved.
    """
    known = None if inexact else contraction or Contraction()
    sizes: list[float] = []
    kept: list[float] = []  # sizes since the last new Jacobian
    error = np.inf
    for iteration in range(max_iterations):
        if fresh and not inexact:
            kept, known = [], None
        rtol = ROUGH if inexact else None
        try:
            kept.append(system.correction(fresh, rtol))
        except UnsolvedError as unsolved:
            return NewtonReport(False, tuple(sizes), np.inf, failure=str(unsolved))
        sizes.append(kept[-1])
        watch(iteration, sizes[-1])
        if not np.isfinite(sizes[-1]) or _growing(sizes):
            return NewtonReport(False, tuple(sizes), np.inf)
        first = len(kept) == 1 and kept[0] > 0.0
        error = known.error_left(kept[0]) if known and first else _error_left(kept)
        error = max(error, (rtol or 0.0) * sizes[-1])
        if error <= tolerance:
            known = known.after(kept) if known else Contraction()
            return NewtonReport(True, tuple(sizes), error, known)
        fresh = len(kept) > 1 and kept[-1] > WORST_CONTRACTION * kept[-2]
        if inexact:
            fresh = sizes[-1] > MUCH
    return NewtonReport(False, tuple(sizes), error)


def _error_left(sizes: list[float]) -> float:
    if sizes[-1] == 0.0:
        return 0.0
    # A single update shows no contraction.
    contraction = sizes[-1] / sizes[-2] if len(sizes) > 1 else 1.0
    if contraction >= 0.5:  # perhaps at round-off
        return 0.0 if sizes[-1] < 1e-13 else np.inf
    return sizes[-1] * contraction / (1 - contraction)


def _growing(sizes: list[float]) -> bool:
    last = sizes[-4:]
    return len(last) == 4 and all(later > 1.5 * earlier for earlier, later in pairwise(last))
