"""Error bars of a critical flow.

The safety factor S is 1 there, with a range [S_low, S_high], and nearby proportional to f^-p with the flow's factor f:
the critical factor has the range [f S_low^(1/p), f S_high^(1/p)].
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..arrays import Floats
from ..contact.robustness import ErrorBox, safety_range
from ..results.errorbars import ErrorBars
from .search import CriticalFlow


@dataclass(frozen=True)
class CriticalBars:
    """Error bars of the critical factor.

    low, high: range with all errors together
    terms:     largest error of each source alone
    loads:     errors of force and torque at the critical flow
    """

    factor: float
    low: float
    high: float
    terms: dict[str, float]
    loads: ErrorBars

    def to_dict(self) -> dict[str, Any]:
        factor = {"low": self.low, "high": self.high, "terms": self.terms}
        return {"factor": factor, "load": self.loads.to_dict()}

    def lines(self) -> list[str]:
        known = ", ".join(f"{name} {error:.1e}" for name, error in self.terms.items())
        missing = self.loads.left_out | {
            name: f"not computed: {why}" for name, why in self.loads.failed.items()
        }
        added = f"absolute errors of that multiple, added in full: {known}"
        lines = [f"error bars          {added if known else 'none is known'}"]
        return lines + [f"  {name:<18}{why}" for name, why in missing.items()]


def critical_bars(flow: CriticalFlow, loads: ErrorBars) -> CriticalBars:
    """Error bars of a critical flow from those of force and torque there."""
    errors = {term.name: term.load for term in loads.terms}
    if flow.own_mesh is not None:
        errors["own mesh"] = flow.own_mesh.change
    ranges = {name: factor_range(flow, error) for name, error in errors.items()}
    low, high = factor_range(flow, sum(errors.values(), np.zeros(6)))
    if flow.between is not None:
        below, above = ranges["search"] = flow.between
        low, high = low + below - flow.factor, high + above - flow.factor
    terms = {name: max(flow.factor - a, b - flow.factor) for name, (a, b) in ranges.items()}
    return CriticalBars(flow.factor, max(low, 0.0), high, terms, loads)


def corrected(flow: CriticalFlow, loads: ErrorBars) -> tuple[CriticalFlow, ErrorBars]:
    """The critical flow of the corrected load, with the error bars of that load.

    The correction is proportional to the factor; without a critical flow nearby both are uncorrected.
    """
    change = loads.correction
    if change is None:
        return flow, loads
    path = replace(flow.path, loads=flow.path.loads + change / flow.factor)
    for width in (0.02, 0.1, 0.3):
        low, high = flow.factor / (1.0 + width), flow.factor * (1.0 + width)
        if path.safety(low) > 1.0 and (factor := path.loss(low, high)) is not None:
            held_to = factor if flow.held_to == flow.factor else flow.held_to
            return replace(flow, factor=factor, path=path, held_to=held_to), loads
    return flow, replace(loads, terms=tuple(term.uncorrected for term in loads.terms))


def factor_range(flow: CriticalFlow, error: Floats) -> tuple[float, float]:
    """Range of the critical factor within an error (6,) of force and torque."""
    path, factor = flow.path, flow.factor
    safety = safety_range(flow.load, path.contacts, path.law, ErrorBox.of(error))
    power = path.steepness(factor)
    # A load that does not grow there leaves the factor unknown; where S jumps, only S = 0 and infinity do.
    exponent = 1.0 / min(power, 1e9) if power > 0.0 else math.inf
    low, high = min(safety.low, 1.0), max(safety.high, 1.0)
    return factor * low**exponent, factor * high**exponent
