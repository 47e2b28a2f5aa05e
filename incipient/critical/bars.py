"""Error bars of a critical flow: what errors of force and couple, and of the search itself, mean for its factor.

Within the errors of the load at the critical flow the safety factor, one there, is in a range [S_low, S_high]. Along
the path of the load S goes as a power -p of the factor nearby, so that the critical factor f is in
[f S_low^(1/p), f S_high^(1/p)].
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..accuracy.goal import Errors, components, slopes
from ..arrays import Floats
from ..contact.robustness import ErrorBox, safety_range
from ..contact.safety import safety_factor
from ..results.errorbars import ErrorBars
from ..results.loads import Couples, Forces
from .search import Found

Range = tuple[float, float]

ADDED = "absolute errors of that multiple, added in full: "
OWN_MESH = "own mesh"  # what a mesh made for the walls in the critical flow itself changes
DIFFERENCE = 1e-4  # of the load, for derivatives of the safety factor
NEARBY = (
    0.02,
    0.1,
    0.3,
)  # how far from the computed critical flow the corrected one is looked for, relative


@dataclass(frozen=True)
class CriticalBars:
    """Error bars of the factor of a critical flow.

    low, high: range of the factor with all errors together
    terms:     largest error of the factor that each source makes alone
    loads:     the errors of force and couple at the critical flow
    """

    factor: float
    low: float
    high: float
    terms: dict[str, float]
    loads: ErrorBars

    @property
    def error(self) -> float:
        """The larger of the errors below and above the factor."""
        return max(self.factor - self.low, self.high - self.factor)

    def to_dict(self) -> dict[str, Any]:
        """Plain data for threshold.json; an error without bound is None there."""
        factor = {"low": self.low, "high": self.high, "error": self.error, "terms": self.terms}
        return {"factor": factor, "load": self.loads.to_dict()}

    def lines(self) -> list[str]:
        """Where the error of the factor comes from, for a reader."""
        known = [f"{name} {error:.1e}" for name, error in self.terms.items()]
        lines = [f"error bars          {ADDED if known else 'none is known'}{', '.join(known)}"]
        lines += [f"  {name:<18}{why}" for name, why in self.loads.left_out.items()]
        return lines + [
            f"  {name:<18}not computed: {why}" for name, why in self.loads.failed.items()
        ]


def critical_bars(found: Found, loads: ErrorBars) -> CriticalBars:
    """The error bars of a critical flow from those of force and couple there. Not collective."""
    errors = {term.name: np.concatenate([term.force, term.couple]) for term in loads.terms}
    if found.own_mesh is not None:
        errors[OWN_MESH] = found.own_mesh.change
    ranges = {name: factor_range(found, {name: error}) for name, error in errors.items()}
    low, high = factor_range(found, errors)
    if found.between is not None:
        below, above = ranges["search"] = found.between
        low, high = low + below - found.factor, high + above - found.factor
    terms = {name: max(found.factor - a, b - found.factor) for name, (a, b) in ranges.items()}
    return CriticalBars(found.factor, max(low, 0.0), high, terms, loads)


def corrected(found: Found, loads: ErrorBars) -> tuple[Found, ErrorBars]:
    """The critical flow of the load corrected by its errors there, and the error bars of that. Not collective.

    Near it the correction is taken to grow with the factor. If the corrected load has no critical flow nearby, both are
    as without corrections.
    """
    change = loads.correction
    if change is None:
        return found, loads
    shift = np.concatenate([change.force, change.couple]) / found.factor
    path = replace(found.path, loads=found.path.loads + shift)
    for width in NEARBY:
        low, high = found.factor / (1.0 + width), found.factor * (1.0 + width)
        if path.judged(low).value > 1.0 and (factor := path.loss(low, high)) is not None:
            held_to = factor if found.held_to == found.factor else found.held_to
            return replace(found, factor=factor, path=path, held_to=held_to), loads
    return found, replace(loads, terms=tuple(term.uncorrected for term in loads.terms))


def factor_range(found: Found, errors: Errors) -> Range:
    """The smallest and the largest critical factor within errors (6,) of force and couple. Not collective."""
    path, factor = found.path, found.factor
    box = ErrorBox.of(sum(errors.values(), np.zeros(6)))
    within = safety_range(found.load, path.contacts, path.friction, box)
    power = path.steepness(factor)
    return factor * _root(min(within.low, 1.0), power), factor * _root(max(within.high, 1.0), power)


def _root(value: float, power: float) -> float:
    """value^(1/power), for a value that is zero or infinite itself; without bound where the power is not positive."""
    if value in (0.0, 1.0, math.inf):
        return value
    if power <= 0.0:
        return 0.0 if value < 1.0 else math.inf
    return float(value ** (1.0 / power))


@dataclass(frozen=True)
class CriticalGoal:
    """The critical flow as the quantity whose error a mesh is refined for (see `accuracy.goal.Quantity`).

    gdim, halved: dimension of the scene, and whether half of it is computed, by its symmetry
    """

    found: Found
    gdim: int = 2
    halved: bool = False
    name: str = "critical flow"

    def error(self, force: Forces, couple: Couples, of_force: Floats, of_couple: Floats) -> float:
        """Relative error of the critical factor for errors (3,) of force and couple."""
        errors = {"discretisation": np.abs(np.concatenate([of_force, of_couple]))}
        low, high = factor_range(self.found, errors)
        return max(high / self.found.factor - 1.0, 1.0 - low / self.found.factor)

    def goals(self, force: Forces, couple: Couples) -> list[Floats]:
        """Derivatives (3,), in space (6,), of log factor along force and couple; along the force, where S jumps."""
        found, load = self.found, self.found.load
        path, size = found.path, float(np.linalg.norm(load.flow_force))
        places, steps = (
            components(self.gdim, self.halved),
            np.full(3 * self.gdim - 3, DIFFERENCE * size),
        )
        holds = (path.contacts, path.friction)
        by_load = slopes(load, steps, places, lambda one: safety_factor(one, *holds).value)
        by_load /= path.steepness(found.factor)
        if np.all(np.isfinite(by_load)) and np.any(by_load):
            return [by_load]
        return list(np.eye(len(by_load))[[i for i in places if i < self.gdim]] / size)
