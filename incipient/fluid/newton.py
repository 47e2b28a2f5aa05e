"""Newton's method on an assembled system, with the remaining error estimated from the contraction of the updates."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, Protocol

import numpy as np

from ..errors import UnsolvedError

WORST_CONTRACTION = 0.3
# Residual, relative to the right-hand side, to which iterations solve for a correction that is still far off.
ROUGHEST = 1e-3
# Solves by one correction with the same factors, after which a second one measures the contraction again.
MEASURED_EVERY = 8
MUCH = 0.05  # of the state: a change after which an older preconditioner would not help


class System(Protocol):
    """Interface of a discretised problem for Newton's method; all methods are collective."""

    def correction(self, fresh: bool, rtol: float | None) -> float:
        """Subtract a Newton update, `fresh` with a new factorisation or preconditioner; its size relative to the state.

        Its linear system, by a new Jacobian, is solved to a residual of `rtol`; None: the Jacobian is that of the
        factorisation, and the solution is as accurate as that.
        """
        ...


@dataclass(frozen=True)
class Contraction:
    """The contraction of Newton updates with the present LU factorisation, as far as it is known.

    ratio:    second update of a solve over its first, as last measured
    measured: number of the solve, since the factorisation, in which the ratio was measured
    solves:   number of solves with this factorisation after that for which it was made
    """

    ratio: float = np.inf
    measured: int = 0
    solves: int = 0

    def error_left(self, size: float) -> float:
        """Remaining error after a first update of this size; infinite where the ratio is uncertain.

        The factorisation ages with each solve: the ratio is assumed to grow in proportion to its age.
        """
        if not self.measured or self.solves - self.measured >= MEASURED_EVERY:
            return np.inf
        ratio = self.ratio * (self.solves + 1) / self.measured
        return size * ratio / (1 - ratio) if ratio < 0.5 else np.inf

    def after(self, sizes: list[float]) -> Contraction:
        """The contraction after another solve with Newton updates of these sizes."""
        number = self.solves + 1
        if len(sizes) < 2 or sizes[0] == 0.0:
            return replace(self, solves=number)
        # The first two tell how a first correction contracts; later ones are nearer to round-off.
        return Contraction(sizes[1] / sizes[0], number, number)


@dataclass(frozen=True)
class NewtonReport:
    """Report of an iteration: sizes of the Newton updates relative to the state, and the estimated remaining error.

    `contraction` is that of the present factorisation, for its next solve. `failure` says why the linear system of
    the next update was not solved; empty: it was.
    """

    converged: bool
    corrections: tuple[float, ...]
    error: float
    contraction: Contraction = Contraction()
    failure: str = ""

    @property
    def iterations(self) -> int:
        """Number of corrections."""
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

    A Jacobian and its factorisation are kept while they contract well: an update then costs one residual and one
    back-substitution. New ones are made at the start if `fresh`, and whenever an update is more than
    `WORST_CONTRACTION` of the one before. With the `contraction` of earlier solves one update is enough
    where it leaves at most the tolerance; every `MEASURED_EVERY` solves a second one checks that. With `inexact`
    every update has a new Jacobian, its system is solved only to the accuracy of the update, and the linear residual
    counts; the preconditioner is renewed after an update of more than `MUCH` of the state.

    Stops when updates have grown three times in a row by half or more, are not finite, or when a linear system
    is not solved, and reports `converged=False`: the caller decides what to do.
    """
    known = None if inexact else contraction or Contraction()
    sizes: list[float] = []
    kept: list[float] = []  # sizes since the Jacobian was made
    error = np.inf
    for iteration in range(max_iterations):
        if fresh and not inexact:
            kept, known = [], None
        rtol = _inner_tolerance(sizes, tolerance) if inexact else None
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
    if len(sizes) < 2:
        # One correction tells nothing about contraction, unless it is at round-off.
        return 0.0 if sizes[-1] < 1e-13 else np.inf
    contraction = sizes[-1] / sizes[-2]
    if contraction >= 0.5:
        return 0.0 if sizes[-1] < 1e-13 else np.inf
    return sizes[-1] * contraction / (1 - contraction)


def _inner_tolerance(sizes: list[float], tolerance: float) -> float:
    """The tolerance of the linear iterations: no finer than the gain of the Newton update, or than needed.

    The gain is 0.9 times the square of the last, after Eisenstat & Walker (1996), SIAM J. Sci. Comput. 17, 16 (choice
    2), the sizes of Newton updates instead of residuals. It is also the expected ratio of the update to the last.
    """
    if len(sizes) < 2 or 0.0 in sizes[-2:]:
        return ROUGHEST
    gain = (sizes[-1] / sizes[-2]) ** 2
    enough = 0.1 * tolerance / (gain * sizes[-1])
    return float(np.clip(max(0.9 * gain, enough), max(1e-12, 0.01 * tolerance), ROUGHEST))


def _growing(sizes: list[float]) -> bool:
    last = sizes[-4:]
    return len(last) == 4 and all(later > 1.5 * earlier for earlier, later in pairwise(last))
