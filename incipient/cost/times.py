"""Processor times of runs that are like a scene's, by the runs that this machine's calibration knows."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from ..planning import drawing
from . import calibration as calibrations
from .calibration import Calibration
from .counts import Counts
from .frontier import seconds
from .prices import STEADY, Known, Prices, Work, correction, memory_correction, most_alike, prices, work_like

if TYPE_CHECKING:
    from ..planning.plan import Estimate
    from ..scene import Scene

OWN, FOREIGN = 1.4, 2.0  # factors within which times of a scene's own runs, and those of others, are trusted
LEAST_RUNS = 4  # below this there is nothing to fit prices to


@dataclass(frozen=True, kw_only=True)
class Expected:
    """Processor time [s] with its range and memory [MiB] of a command on one process.

    own: whether runs of the scene itself are known, or only others; source: the same in words
    """

    cpu: float
    low: float
    high: float
    peak_mib: float
    own: bool
    source: str

    def sentence(self) -> str:
        """One line for a reader."""
        return (
            f"about {seconds(self.cpu)} of processor time ({seconds(self.low)} to {seconds(self.high)}), "
            f"{self.peak_mib:.0f} MiB at the peak, error bars included, {self.source}"
        )


@dataclass(frozen=True)
class Times:
    """What runs of a scene take, finer or coarser ones too.

    own:    runs of the scene itself that are known
    factor: what makes the prices right for them
    """

    calibration: Calibration
    prices: Prices
    factor: float
    scene: Scene
    own: tuple[Known, ...]

    @classmethod
    def of(cls, scene: Scene, calibration: Calibration) -> Times | None:
        """By the runs of a calibration; None if they are too few."""
        if len(calibration.runs) < LEAST_RUNS:
            return None
        fitted, own = prices(calibration.runs), calibration.of(calibrations.digest(scene))
        return cls(calibration, fitted, correction(fitted, own), scene, tuple(own))

    def expected(self, cpu: float, low: float, high: float, unknowns: Iterable[int]) -> dict[str, Any]:
        """The fields of `Expected` for times [s] that are right if prices are, and systems there at once."""
        trust = OWN if self.own else FOREIGN
        return {
            "cpu": cpu,
            "low": low / trust,
            "high": high * trust,
            "peak_mib": memory_correction(self.own or self.calibration.runs) * drawing.memory(*unknowns),
            "own": bool(self.own),
            "source": f"by runs of {'this scene' if self.own else 'other scenes'} on this machine",
        }

    def beyond_start(self, scene: Scene, estimate: Estimate) -> float:
        """Processor time [s] of computing a scene, without starting the program and without error bars."""
        return self.factor * self.prices.beyond_start(self._work(scene, estimate))

    def error_bars(self, scene: Scene, estimate: Estimate) -> float:
        """Processor time [s] of the error bars of a scene."""
        if not scene.numerics.error_bars or scene.body is None:
            return 0.0
        from ..accuracy.errorbars import coarse_scenes

        dual = self.dual(estimate, scene.numerics.order) if drawing.has_dual(scene) else 0.0
        return dual + self.again(coarse_scenes(scene))

    def again(self, scenes: Iterable[Scene]) -> float:
        """Processor time [s] of computing other scenes in the same process; their meshes are made to count them.

        Raises:
            MeshError: one of them cannot be made.
        """
        return sum(self.further(scene, counted(scene)) for scene in scenes)

    def further(self, scene: Scene, estimate: Estimate) -> float:
        """Processor time [s] of computing a scene in a process that has computed one."""
        return self.factor * self.prices.again(self._work(scene, estimate))

    def dual(self, estimate: Estimate, order: int) -> float:
        """Processor time [s] of one correction with elements of one order more on the same mesh, which is there."""
        unknowns = finer_unknowns(estimate.unknowns, order)
        work = Work(STEADY, order + 1, estimate.cells, unknowns, Counts(newton=1, factorisations=1, krylov=4))
        unmeshed = Work(STEADY, order + 1, estimate.cells, unknowns)
        return self.factor * (self.prices.beyond_start(work) - self.prices.beyond_start(unmeshed))

    def _work(self, scene: Scene, estimate: Estimate) -> Work:
        step = scene.time.step if scene.time else None
        order, kind = scene.numerics.order, calibrations.kind(scene)
        # The scene of an error bar has the iterations of the scene itself.
        like = calibrations.known(
            self.scene,
            Work(kind, order, estimate.cells, estimate.unknowns),
            scene.numerics.mesh_size,
            step,
            start=0.0,
            cpu=0.0,
            peak_mib=0.0,
        )
        found = most_alike(self.calibration.runs, like)
        return work_like(found, order, estimate.cells, estimate.unknowns, _steps(scene, like, found))


def _steps(scene: Scene, like: Known, found: Known) -> float:
    """How many steps a run will make: in proportion to those of the same scene, which may end before its time."""
    if scene.time is None:
        return 0.0
    if found.scene == like.scene and found.step:
        return found.work.counts.steps * found.step / like.step
    return scene.time.end / scene.time.step


def counted(scene: Scene) -> Estimate:
    """Cells and unknowns of a scene, by making its mesh."""
    from ..simulation.build import estimate

    made = estimate(scene).estimate
    assert made is not None
    return made


def finer_unknowns(unknowns: int, order: int) -> int:
    """Unknowns with elements of one order more on the same mesh."""
    before, after = (k**2 + (k - 1) ** 2 / 2.0 for k in (order, order + 1))
    return round(unknowns * after / before)
