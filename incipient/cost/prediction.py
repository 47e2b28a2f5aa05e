"""What a scene's run will take and how accurate it will be, by the calibration of this machine."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from . import calibration as calibrations
from .calibration import Calibration
from .frontier import percent
from .times import Expected, Times, finer_unknowns

if TYPE_CHECKING:
    from ..planning.plan import Estimate
    from ..scene import Scene

# The least that errors of own runs, and those of others, are trusted to.
OWN_SPREAD, UNKNOWN_SPREAD = 2.0, 5.0
STUDY = "run `incipient cost SCENE` for this scene"
HOW = f"{STUDY}, or `incipient calibrate` once for the machine"


@dataclass(frozen=True)
class PredictedError:
    """A relative error and the range it may lie in."""

    value: float
    low: float
    high: float


@dataclass(frozen=True, kw_only=True)
class Prediction(Expected):
    """What a run is expected to take, and its relative errors by quantity."""

    errors: Mapping[str, PredictedError] = field(default_factory=dict)

    def text(self) -> str:
        """A few lines for a reader."""
        lines = [f"  {self.sentence()}"]
        for goal, error in self.errors.items():
            between = f"{percent(error.low)} to {percent(error.high)}"
            lines.append(f"  error of the {goal} about {percent(error.value)} ({between})")
        if not self.errors:
            lines.append("  errors: none are known for scenes of this kind; run `incipient cost SCENE`")
        elif not self.own:
            lines.append(
                "  errors are those of other scenes of its kind; for its own: `incipient cost SCENE`"
            )
        return "\n".join(lines)


def predict(scene: Scene, estimate: Estimate) -> Prediction | None:
    """What the run of a scene will take, None if this machine is not calibrated. Not collective.

    Args:
        scene: what will be run.
        estimate: cells and unknowns, counted on its mesh.

    Raises:
        MeshError: a coarse mesh for the error bars cannot be made.
    """
    calibration = calibrations.read()
    times = Times.of(scene, calibration)
    if times is None:
        return None
    cpu = times.prices.start + times.beyond_start(scene, estimate) + times.error_bars(scene, estimate)
    unknowns = [estimate.unknowns]
    if scene.time is None and scene.body is not None and scene.numerics.error_bars:
        unknowns.append(finer_unknowns(estimate.unknowns, scene.numerics.order))
    return Prediction(**times.expected(cpu, cpu, cpu, unknowns), errors=errors_of(calibration, scene))


def uncalibrated() -> str:
    """What to say without a calibration."""
    return f"  time and accuracy: not known on this machine yet; {HOW}"


def errors_of(calibration: Calibration, scene: Scene) -> dict[str, PredictedError]:
    """Errors by the scene's own laws, else by those of all scenes of its kind."""
    step = calibrations.step_of_flow(scene, scene.time.step if scene.time else None)
    own = calibration.errors.get(calibrations.digest(scene))
    known = [own] if own else [k for k in calibration.errors.values() if k.kind == calibrations.kind(scene)]
    found: dict[str, list[tuple[float, float]]] = {}
    for one in known:
        for goal, law in one.laws.items():
            error = law.error(scene.numerics.order, scene.numerics.mesh_size, step)
            found.setdefault(goal, []).append(error)
    expected = _goals(scene)
    predicted = {}
    for goal, errors in found.items():
        if own is None and goal not in expected:
            continue
        value, factor = calibrations.spread_of(errors)
        factor = max(factor, OWN_SPREAD if own else UNKNOWN_SPREAD)
        if math.isfinite(value):
            predicted[goal] = PredictedError(value, value / factor, value * factor)
    return predicted


def _goals(scene: Scene) -> tuple[str, ...]:
    """Which errors a scene may have in common with others."""
    if scene.body is None:
        return ("minimum of v1", "maximum of v2", "minimum of v2", "kinetic energy")
    return ("place", "angle") if scene.body.moves else ("force", "couple", "safety factor")
