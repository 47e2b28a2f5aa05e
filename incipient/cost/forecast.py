"""What a run that is asked for accuracy will come to: its first mesh, and by the calibration its last one.

Steady flow: the error on the first mesh is taken from the law of errors, and from it follow order and unknowns of the
next mesh as the run will choose them (`incipient.adaptive.refinement`). Flow in time: the law tells at which of the
ever finer runs (`incipient.adaptive.halving`) the accuracy is reached. A verdict, and the load on a grain that moves,
have no such law.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

from . import calibration as calibrations
from .frontier import percent
from .ladder import LARGEST
from .prediction import HOW, STUDY, PredictedError, errors_of
from .times import Expected, Times, counted, finer_unknowns

if TYPE_CHECKING:
    from ..planning.plan import Estimate
    from ..scene import Scene

BEYOND = 2.5  # by what the law may err besides on a first mesh far coarser than it was found on: measured
MISSED = 1.6  # factor within which unknowns follow from the error on the first mesh: measured
LIMIT = "numerics.budget_seconds limits the time"
Law = Callable[["Scene"], dict[str, PredictedError]]


@dataclass(frozen=True, kw_only=True)
class Foresight(Expected):
    """The last mesh of a run to an accuracy as it is expected, and what all of its meshes together take.

    first:   relative error on the first mesh
    fewest, most: unknowns of the last mesh if errors are at either end of their range
    runs:    meshes tried, the first included; step: of the last one, None for steady flow
    reaches: whether the accuracy will be reached
    """

    first: PredictedError
    order: int
    unknowns: int
    fewest: int
    most: int
    runs: int
    step: float | None
    reaches: bool

    def text(self) -> str:
        """A few lines for a reader."""
        between = f"{percent(self.first.low)} to {percent(self.first.high)}"
        return "\n".join(
            [
                f"  error on the first mesh about {percent(self.first.value)} ({between})",
                f"  {self._last()}",
                f"  {self.sentence()}",
            ]
        )

    def _last(self) -> str:
        if self.runs == 1:
            more = f"; if not, up to {_rounded(self.most)} unknowns" if self.most > self.unknowns else ""
            return f"the first mesh is expected to do{more}"
        reached = "the last" if self.reaches else "not to be reached, the last"
        step = "" if self.step is None else f", step {self.step:.3g}"
        few, many = _rounded(self.fewest), _rounded(self.most)
        between = f" ({few} to {many})" if few != many else ""
        return (
            f"{self.runs} meshes expected, {reached} of about {_rounded(self.unknowns)} unknowns{between} "
            f"in P{self.order}-P{self.order - 1}{step}"
        )


@dataclass(frozen=True)
class _Run:
    """A mesh that will be tried: the scene with its order, cell sizes and step, and what it needs."""

    scene: Scene
    estimate: Estimate

    @property
    def order(self) -> int:
        """Of the velocity."""
        return self.scene.numerics.order


@dataclass(frozen=True)
class _Path:
    """The meshes from the first to the last."""

    runs: tuple[_Run, ...]
    reaches: bool = True

    @property
    def last(self) -> _Run:
        """That which is to reach the accuracy."""
        return self.runs[-1]


def first_mesh(scene: Scene) -> Estimate:
    """Cells, unknowns and memory on the first mesh of a run to an accuracy, by making it. Not collective.

    Raises:
        MeshError: it cannot be made.
    """
    if scene.time is not None:
        from ..adaptive import halving

        return counted(halving.first(scene))
    from ..adaptive.refinement import COARSEST, coarse_sizes
    from ..planning import drawing
    from ..planning.plan import make_plan

    plan = make_plan(scene)
    return drawing.count(coarse_sizes(COARSEST, None, drawing.lay_out(scene, plan)), plan.order, dual=True)


def foresee(scene: Scene, estimate: Estimate) -> Foresight | str:
    """What a run to `numerics.accuracy` will come to, or in words why that is not known. Not collective.

    Args:
        scene: with a number for its accuracy, or "verdict".
        estimate: cells and unknowns on its first mesh.

    Raises:
        MeshError: a coarse mesh for the error bars cannot be made.
    """
    unknown = "  final mesh, time and memory: not known"
    asked = scene.numerics.accuracy
    if not isinstance(asked, float | int):
        return f"{unknown}: they hang on what decides the verdict; {LIMIT}"
    if scene.numerics.accuracy_includes == "all":
        return f"{unknown}: gap and domain are chosen by coarse runs before; {LIMIT}"
    calibration = calibrations.read()
    times = Times.of(scene, calibration)
    if times is None:
        return f"{unknown} on this machine yet; {HOW}"
    law = partial(errors_of, calibration)
    error = law(_as_first(scene)).get(scene.numerics.accuracy_of)
    if error is None or (scene.time is not None and scene.time.tolerance is not None):
        return f"{unknown}: {_why(scene)}"
    if scene.time is None:
        error = replace(error, low=error.low / BEYOND, high=error.high * BEYOND)
    return _foreseen(times, estimate, error, law, asked)


def _as_first(scene: Scene) -> Scene:
    """The scene with cells and steps of its first mesh, as far as the law of errors knows of them."""
    from ..accuracy.errorbars import changed
    from ..adaptive import halving
    from ..adaptive.refinement import COARSEST

    if scene.time is not None:
        return halving.first(scene)
    return changed(scene, numerics={"mesh_size": min(COARSEST * scene.numerics.mesh_size, LARGEST)})


def _why(scene: Scene) -> str:
    if scene.body is not None and scene.body.moves:
        return f"there is no law of errors for the load on a grain that moves; {LIMIT}"
    if scene.time is not None and scene.time.tolerance is not None:
        return f"there is no law of errors for steps that adapt; {LIMIT}"
    return f"no error of the {scene.numerics.accuracy_of} is known for scenes of this kind; {STUDY}"


def _foreseen(times: Times, estimate: Estimate, error: PredictedError, law: Law, asked: float) -> Foresight:
    """The path that is expected, and those for errors at either end of their range."""
    if times.scene.time is None:
        errors = (error.low, error.value, error.high)
        low, likely, high = (_steady(times.scene, estimate, asked, value) for value in errors)
    else:
        low, likely, high = _in_time(times.scene, estimate, asked, law, error)
    last = likely.last
    # The second mesh is foreseen from the first: its unknowns lie beside what the errors alone would tell.
    missed = MISSED if last.scene.time is None else 1.0
    fewest, most = low.last.estimate.unknowns, high.last.estimate.unknowns
    return Foresight(
        **times.expected(_cpu(times, likely), _cpu(times, low), _cpu(times, high), _at_once(last)),
        first=error,
        order=last.order,
        unknowns=last.estimate.unknowns,
        fewest=max(estimate.unknowns, round(fewest / missed)),
        most=round(most * (missed if len(high.runs) > 1 else 1.0)),
        runs=len(likely.runs),
        step=last.scene.time.step if last.scene.time else None,
        reaches=likely.reaches,
    )


def _steady(scene: Scene, estimate: Estimate, asked: float, error: float) -> _Path:
    """The first mesh, of this error, and where it does not do the second as the run will choose it.

    That mostly is the last.
    """
    from ..accuracy.errorbars import changed
    from ..adaptive.refinement import AIM, GAIN, UNKNOWNS, cheapest_order

    first = _Run(scene, estimate)
    if error <= asked:
        return _Path((first,))
    order = cheapest_order(first.order, error / asked / AIM)
    left = error * GAIN ** (order - first.order) / (AIM * asked)
    cells = estimate.cells * max(1.0, left) ** (1.0 / order)
    per_cell = estimate.unknowns / estimate.cells * UNKNOWNS[order] / UNKNOWNS[first.order]
    last = replace(estimate, cells=round(cells), unknowns=round(per_cell * cells))
    return _Path((first, _Run(changed(scene, numerics={"order": order}), last)))


def _in_time(
    scene: Scene, estimate: Estimate, asked: float, law: Law, error: PredictedError
) -> tuple[_Path, _Path, _Path]:
    """Ever finer runs, until the error, that by which the last two differ, is small enough.

    For errors at the lower end of their range, in its middle and at its upper end.
    """
    from ..adaptive.halving import MOST_RUNS, finer, first

    largest, least = (value / error.value for value in (error.high, error.low))
    runs, errors = [_Run(first(scene), estimate)], [math.inf]
    while largest * errors[-1] > asked and len(runs) < MOST_RUNS:
        following = finer(runs[-1].scene)
        runs.append(_Run(following, counted(following)))
        errors.append(law(following)[scene.numerics.accuracy_of].value)
    return (
        _until(runs, errors, asked / least),
        _until(runs, errors, asked),
        _until(runs, errors, asked / largest),
    )


def _until(runs: Sequence[_Run], errors: Sequence[float], asked: float) -> _Path:
    """The runs up to the first with an error below that asked for, all if there is none."""
    enough = next((number for number, error in enumerate(errors, 1) if error <= asked), None)
    return _Path(tuple(runs[:enough]), reaches=enough is not None)


def _cpu(times: Times, path: _Path) -> float:
    """Processor time [s] of all runs of a path, in one process, and of the error bars."""
    first, *others = path.runs
    cpu = times.prices.start + times.beyond_start(first.scene, first.estimate)
    cpu += sum(times.further(run.scene, run.estimate) for run in others)
    if times.scene.time is None:
        cpu += sum(times.dual(run.estimate, run.order) for run in path.runs)
    return cpu + times.again(_coarse_scenes(path.last.scene))


def _coarse_scenes(scene: Scene) -> list[Scene]:
    """Runs that the error bars need besides those of the path."""
    from ..accuracy.errorbars import coarse_scenes, coarser

    if not scene.numerics.error_bars:
        return []
    known = coarser(scene) if scene.time is not None else None
    return [coarse for coarse in coarse_scenes(scene) if coarse != known]


def _at_once(last: _Run) -> list[int]:
    """Unknowns of the systems that are there at once at the peak."""
    unknowns = last.estimate.unknowns
    return [unknowns, *([] if last.scene.time else [finer_unknowns(unknowns, last.order)])]


def _rounded(number: int) -> str:
    """A number with two digits that count."""
    return f"{float(f'{number:.2g}'):.0f}"
