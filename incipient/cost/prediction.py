"""What a scene's run will take and how accurate it will be, by the calibration of this machine."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from . import calibration as calibrations
from .calibration import Calibration
from .expense import (
    STEADY,
    Known,
    Prices,
    Work,
    correction,
    memory,
    memory_correction,
    most_alike,
    prices,
    work_like,
)
from .frontier import percent, seconds

if TYPE_CHECKING:
    from ..plan import Estimate
    from ..scene import Scene

OWN, FOREIGN = 1.4, 2.0  # factors within which times of a scene's own runs, and those of others, are trusted
OWN_SPREAD, UNKNOWN_SPREAD = (
    2.0,
    5.0,
)  # the least that errors of own runs, and those of others, are trusted to
LEAST_RUNS = 4  # below this there is nothing to fit prices to
HOW = "run `incipient cost SCENE` for this scene, or `incipient calibrate` once for the machine"


@dataclass(frozen=True)
class PredictedError:
    """A relative error and the range it may lie in."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Prediction:
    """Processor time [s] with its range, memory [MiB] and relative errors of a run on one process.

    own: whether runs of the scene itself are known, or only others
    """

    cpu: float
    low: float
    high: float
    peak_mib: float
    own: bool
    errors: Mapping[str, PredictedError] = field(default_factory=dict)

    def text(self) -> str:
        """A few lines for a reader."""
        source = "runs of this scene" if self.own else "runs of other scenes"
        lines = [
            f"  about {seconds(self.cpu)} of processor time ({seconds(self.low)} to {seconds(self.high)}), "
            f"{self.peak_mib:.0f} MiB at the peak, error bars included, by {source} on this machine"
        ]
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
    if len(calibration.runs) < LEAST_RUNS:
        return None
    fitted, own = prices(calibration.runs), calibration.of(calibrations.digest(scene))
    model = _Model(calibration, fitted, correction(fitted, own), scene)
    cpu = fitted.start + model.beyond_start(scene, estimate) + model.error_bars(estimate)
    factor = OWN if own else FOREIGN
    peak = memory_correction(own or calibration.runs) * memory(*_present(scene, estimate))
    errors = _errors(calibration, scene)
    return Prediction(cpu, cpu / factor, cpu * factor, peak, bool(own), errors)


def uncalibrated() -> str:
    """What to say without a calibration."""
    return f"  time and accuracy: not known on this machine yet; {HOW}"


@dataclass(frozen=True)
class _Model:
    """Times of runs that are like a scene's."""

    calibration: Calibration
    prices: Prices
    factor: float
    scene: Scene

    def beyond_start(self, scene: Scene, estimate: Estimate) -> float:
        """Processor time [s] of computing a scene, without starting the program and without error bars."""
        return self.factor * self.prices.beyond_start(self._work(scene, estimate.cells, estimate.unknowns))

    def _again(self, scene: Scene) -> float:
        """Processor time [s] of computing another scene in the same process."""
        estimate = _counted(scene)
        return self.factor * self.prices.again(self._work(scene, estimate.cells, estimate.unknowns))

    def error_bars(self, estimate: Estimate) -> float:
        """Processor time [s] of the error bars of the scene."""
        if not self.scene.numerics.error_bars or self.scene.body is None:
            return 0.0
        time = 0.0 if self.scene.time else self._dual(estimate)
        return time + sum(self._again(scene) for scene in _coarse_runs(self.scene))

    def _dual(self, estimate: Estimate) -> float:
        """One correction with elements of one order more on the same mesh, which is there already."""
        order = self.scene.numerics.order + 1
        unknowns = _finer_unknowns(self.scene, estimate)
        work = Work(STEADY, order, estimate.cells, unknowns, newton=1, factorisations=1, krylov=4)
        unmeshed = Work(STEADY, order, estimate.cells, unknowns)
        return self.factor * (self.prices.beyond_start(work) - self.prices.beyond_start(unmeshed))

    def _work(self, scene: Scene, cells: int, unknowns: int) -> Work:
        step = scene.time.step if scene.time else None
        order, kind = scene.numerics.order, calibrations.kind(scene)
        # The scene of an error bar has the iterations of the scene itself.
        like = calibrations.known(
            self.scene,
            Work(kind, order, cells, unknowns),
            scene.numerics.mesh_size,
            step,
            start=0.0,
            cpu=0.0,
            peak_mib=0.0,
        )
        found = most_alike(self.calibration.runs, like)
        return work_like(found, order, cells, unknowns, _steps(scene, like, found))


def _steps(scene: Scene, like: Known, found: Known) -> float:
    """How many steps a run will make: in proportion to those of the same scene, which may end before its time."""
    if scene.time is None:
        return 0.0
    if found.scene == like.scene and found.step:
        return found.work.steps * found.step / like.step
    return scene.time.end / scene.time.step


def _coarse_runs(scene: Scene) -> Iterator[Scene]:
    """The runs that error bars make besides the scene's own; see `incipient.accuracy.errorbars`."""
    from ..accuracy import errorbars

    nothing = errorbars.Loads(np.zeros(3), np.zeros(3), np.zeros(3))
    seen: list[Scene] = []

    def keep(changed: Scene) -> errorbars.Loads:
        seen.append(changed)
        return nothing

    if scene.time is not None:
        errorbars.by_coarser_run(scene, nothing, keep)
    else:
        if scene.body is not None and scene.body.x is not None and scene.bed is not None:
            errorbars.of_gap(scene, keep)
        if not errorbars.has_no_far_sides(scene):
            errorbars.of_domain(scene, keep)
    yield from {one.model_dump_json(): one for one in seen}.values()


def _counted(scene: Scene) -> Estimate:
    from ..simulation import estimate

    counted = estimate(scene).estimate
    assert counted is not None
    return counted


def _finer_unknowns(scene: Scene, estimate: Estimate) -> int:
    """Unknowns with elements of one order more on the same mesh."""
    orders = (scene.numerics.order, scene.numerics.order + 1)
    before, after = (order**2 + (order - 1) ** 2 / 2.0 for order in orders)
    return round(estimate.unknowns * after / before)


def _present(scene: Scene, estimate: Estimate) -> tuple[int, ...]:
    """Unknowns of the systems that are there at once at the peak."""
    if scene.time is None and scene.body is not None and scene.numerics.error_bars:
        return estimate.unknowns, _finer_unknowns(scene, estimate)
    return (estimate.unknowns,)


def _errors(calibration: Calibration, scene: Scene) -> dict[str, PredictedError]:
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
