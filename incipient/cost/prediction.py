"""What a run will take and how accurate it will be; where it is to reach an accuracy, its last mesh as well.

All of it is by the laws that studies have found: of the scene itself, else of others of its kind.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import cast

import numpy as np

from ..accuracy import next_mesh
from ..accuracy.coarse_runs import COARSER_MESH, changed, comparisons, on_coarser_mesh
from ..accuracy.errorbars import coarse_scenes
from ..accuracy.first_mesh import counted
from ..accuracy.next_mesh import AIM, COARSEST, UNKNOWNS, coarsest, highest_order, next_order
from ..accuracy.terms import shares
from ..planning import expense
from ..planning.flow_setup import has_inertia, order_of
from ..planning.plan import Estimate
from ..results.adaptation import Trial
from ..scene import Scene
from ..scene.numerics import OF_SURFACE, OF_WALLS
from . import calibration
from .calibration import Findings
from .frontier import percent, seconds
from .ladder import LARGEST
from .laws import error_at, geometric_mean
from .measurement import Variant
from .solvers import SolverOptions

# Factors within which times by runs of the scene, of other scenes, and of another machine are trusted, and errors.
OWN, FOREIGN, ELSEWHERE = 1.4, 2.0, 3.0
OWN_ERROR, FOREIGN_ERROR = 2.0, 5.0
# Error on the first mesh of steady flow over that of laws, which are found on finer cells: measured.
COARSE = 2.5
ESTIMATED = (
    3.0  # error by two coarser meshes over the error, of a mean flow: `benchmarks/accuracy_cost.py`
)
OTHER_ORDER = (
    1.2  # unknowns with elements of one order more, on cells of the same `mesh_size`: measured
)
LIMIT = "numerics.budget_seconds limits the time"


@dataclass(frozen=True)
class Error:
    """A relative error that is known to a factor."""

    value: float
    factor: float

    def __str__(self) -> str:
        return f"about {percent(self.value)} (to a factor of {self.factor:.2g})"


@dataclass(frozen=True)
class KnownLaws:
    """Laws of time and error that studies have found for a scene.

    own:    whether they are of the scene itself; where: which they are, in words
    factor: to which times are trusted
    """

    scene: Scene
    findings: tuple[Findings, ...]
    own: bool
    factor: float
    where: str

    def mean(self, number: Callable[[Findings], float]) -> float:
        """The geometric mean of a number over the findings."""
        return geometric_mean([number(one) for one in self.findings])

    def errors(self, of: Variant) -> dict[str, Error]:
        """Errors by goal of the scene at a variant, of goals that it shares with those studied."""
        velocity, length = self.scene.reference_velocity, self.scene.reference_length
        step = calibration.step_of_flow(of.step, velocity, length)
        at, found = (of.order, of.mesh_size, step), {}
        for goal in dict.fromkeys(goal for one in self.findings for goal in one.errors):
            if goal in self._reported:
                known = [
                    error_at(one.errors[goal], *at) for one in self.findings if goal in one.errors
                ]
                logs = np.log([max(error, 1e-300) for error, _ in known])
                factor = math.exp(2.0 * np.std(logs)) * max(scatter for _, scatter in known)
                least = OWN_ERROR if self.own else FOREIGN_ERROR
                found[goal] = Error(math.exp(np.mean(logs)), max(factor, least))
        return found

    @property
    def _reported(self) -> tuple[str, ...]:
        """Goals that the run of the scene reports; of studies of other scenes those that both have in common."""
        scene = self.scene
        if self.own:
            goals = dict.fromkeys(goal for one in self.findings for goal in one.errors)
            return tuple(goal for goal in goals if goal != "kinetic energy")
        if scene.body is None:
            on_lines = ("minimum of v1", "maximum of v2", "minimum of v2")
            return (*on_lines * scene.has_centrelines, *[OF_WALLS] * scene.is_averaged)
        judged = scene.rests and scene.contact is not None and scene.mass is not None
        loads = ("force", "couple", *["safety factor"] * judged)
        return ("place", "angle") if scene.moves else loads

    def cheaper(self) -> list[str]:
        """Solver options that the last of the studies found to be cheaper than the scene's, in words."""
        last, able = self.findings[-1], SolverOptions(self.scene)
        study = "the last study" if self.own else f'the study of "{last.title}"'
        return [
            f"{' with '.join(able.settings(way))} took {share:.2g} of the time at the same error in {study}"
            for way, share in sorted(last.cheaper.items(), key=lambda one: one[1])
            if able.differs(way)
        ]


def known_laws(scene: Scene, study: Path | None = None) -> KnownLaws | None:
    """Laws known for a scene by a study in a directory, this machine's calibration, or that shipped. Not collective.

    None where no scene of its kind is known. Raises OutputError where the directory holds no study.
    """
    places = (
        (f"in {study}", {} if study is None else calibration.of_study(study), FOREIGN),
        ("on this machine", calibration.read(), FOREIGN),
        ("on another machine", calibration.shipped(), ELSEWHERE),
    )
    for where, known, _ in places[:2]:
        if own := known.get(calibration.digest(scene)):
            return KnownLaws(scene, (own,), True, OWN, f"by runs of this scene {where}")
    kind = calibration.kind(scene)
    for where, known, factor in places:
        if alike := tuple(one for one in known.values() if one.kind == kind):
            return KnownLaws(scene, alike, False, factor, f"by runs of other scenes {where}")
    return None


@dataclass(frozen=True)
class LastMesh:
    """The last mesh of a run to an accuracy as it is expected.

    first: error on the first mesh; meshes: how many are tried; step: None for steady flow
    """

    first: Error
    meshes: int
    order: int
    unknowns: int
    step: float | None
    reaches: bool

    def text(self) -> str:
        """The expected meshes in two lines."""
        said, reached = (
            "the first mesh is expected to do",
            "" if self.reaches else "not to be reached, ",
        )
        if self.meshes > 1:
            rounded = float(f"{self.unknowns:.2g}")
            unknowns = f"about {rounded:.0f} unknowns in P{self.order}-P{self.order - 1}"
            said = f"{self.meshes} meshes expected, {reached}the last of {unknowns}"
            said += "" if self.step is None else f", step {self.step:.3g}"
        return f"  error on the first mesh {self.first}\n  {said}"


@dataclass(frozen=True)
class Prediction:
    """Processor time [s] that is known to a factor, memory [MiB] and relative errors by quantity.

    own:  whether runs of the scene itself are known, or only others; source: the same in words
    last: where an accuracy is asked for, which then is the error
    """

    cpu: float
    factor: float
    peak_mib: float
    own: bool
    source: str
    errors: Mapping[str, Error]
    last: LastMesh | None

    def text(self) -> str:
        """A few lines for a reader."""
        lines = [self.last.text()] if self.last else []
        time = f"about {seconds(self.cpu)} of processor time (to a factor of {self.factor:g})"
        lines.append(
            f"  {time}, {self.peak_mib:.0f} MiB at the peak, error bars included, {self.source}"
        )
        lines += [f"  error of the {goal} {error}" for goal, error in self.errors.items()]
        return "\n".join(
            [*lines, *([] if self.own else ["  better known after `incipient cost SCENE`"])]
        )


@dataclass(frozen=True)
class _Run:
    """A scene with the unknowns on its mesh."""

    scene: Scene
    unknowns: int

    @property
    def variant(self) -> Variant:
        """Cells, order and steps."""
        time, size = self.scene.time, self.scene.numerics.mesh_size
        return Variant(order_of(self.scene).number, size, time.step if time else None)

    @property
    def size(self) -> tuple[int, float]:
        """Unknowns and time steps."""
        time = self.scene.time
        return self.unknowns, time.end / time.step if time else 0.0

    @property
    def of_dual(self) -> int:
        """Unknowns with elements of one order more, in which errors of steady flow are estimated."""
        order = order_of(self.scene).number
        before, after = (k**2 + (k - 1) ** 2 / 2.0 for k in (order, order + 1))
        return round(self.unknowns * after / before)


def predict(known: KnownLaws, first: Estimate) -> Prediction | str:
    """Prediction of the run of a scene, or in words why it is not known. Not collective; raises MeshError.

    `first`: cells and unknowns on its mesh, the first one where an accuracy is asked for.
    """
    scene, last, path = known.scene, None, [_Run(known.scene, first.unknowns)]
    if scene.numerics.accuracy is not None:
        found = _search(known, first.unknowns)
        if isinstance(found, str):
            return f"  final mesh, time and memory: not known: {found}"
        path, last = found
    end, bars = path[-1], scene.has_error_bars
    wanted = coarse_scenes(end.scene) if bars else []
    beside: list[_Run] = []
    if last and scene.time is not None:
        beside = [one for run in path for one in _compared_with(run)]
        wanted = [one for one in wanted if one not in comparisons(end.scene)]
    elif last and scene.is_averaged:  # the meshes before the last are those it is compared with
        coarser = on_coarser_mesh(end.scene)
        wanted = [one for one in wanted if one not in (coarser, on_coarser_mesh(coarser))]
    others = [_Run(one, counted(one).unknowns) for one in wanted]
    runs = [run.size for run in (*path, *beside, *others)]
    of_loads = scene.time is None and scene.body is not None and not scene.is_averaged
    has_duals = of_loads and (bars or last is not None)
    duals = [run.of_dual for run in path] if has_duals else []
    cpu = known.mean(lambda one: one.time.seconds(runs, duals))
    memory = known.mean(lambda one: one.memory) * expense.memory(end.unknowns, *duals[-1:])
    errors = {} if last else known.errors(path[-1].variant)
    return Prediction(cpu, known.factor, memory, known.own, known.where, errors, last)


def _search(known: KnownLaws, unknowns: int) -> tuple[list[_Run], LastMesh] | str:
    """The meshes of a run to an accuracy that starts from so many unknowns, or why they are not known."""
    scene, numerics, time = known.scene, known.scene.numerics, known.scene.time
    if not isinstance(numerics.accuracy, float | int):
        return f"they depend on what decides the verdict; {LIMIT}"
    if numerics.accuracy_includes == "all":
        return f"gap and domain are chosen by coarse runs before; {LIMIT}"
    if scene.accuracy_of in OF_SURFACE[0 if scene.body is not None else 1 :]:
        of = "levels at the end" if scene.body is None else "elevations above a grain"
        return f"there is no law of errors for {of}; {LIMIT}"
    if scene.moves:
        return f"there is no law of errors for the load on a grain that moves; {LIMIT}"
    if time is not None and time.tolerance is not None:
        return f"there is no law of errors for steps that adapt; {LIMIT}"
    factor = COARSEST if scene.is_averaged else coarsest(scene.gdim, has_inertia(scene))
    first = _Run(next_mesh.first(scene) if time else _sized(scene, factor), unknowns)
    error = known.errors(first.variant).get(scene.accuracy_of)
    if error is None:
        return f"no error of the {scene.accuracy_of} is known for scenes of this kind; run `incipient cost SCENE`"
    asked, reaches = numerics.accuracy, True
    if scene.is_averaged:
        path, reaches = _alike(first, known, asked)
    elif time is None:
        error = replace(error, value=COARSE * error.value)
        path = _refined(_Run(scene, unknowns), error.value / asked)
    else:
        path, reaches = _balanced(first, known, asked)
    end, time = path[-1], path[-1].scene.time
    step = time.step if time else None
    return path, LastMesh(error, len(path), order_of(end.scene).number, end.unknowns, step, reaches)


def _sized(scene: Scene, factor: float) -> Scene:
    """The scene with cells enlarged by a factor, up to the largest `numerics.mesh_size`. Not collective."""
    return changed(scene, numerics={"mesh_size": min(factor * scene.numerics.mesh_size, LARGEST)})


def _alike(first: _Run, known: KnownLaws, asked: float) -> tuple[list[_Run], bool]:
    """Meshes of a mean flow, all cells smaller alike, until the estimate is small enough; whether it is."""
    path = [first]
    while len(path) < next_mesh.MOST_MESHES:
        scene = _sized(path[-1].scene, 1.0 / COARSER_MESH)
        grows = path[-1].unknowns / path[-2].unknowns if len(path) > 2 else 0.0
        unknowns = grows * path[-1].unknowns if grows else counted(scene).unknowns
        path.append(_Run(scene, round(unknowns)))
        error = known.errors(path[-1].variant)[first.scene.accuracy_of].value
        if len(path) > 2 and ESTIMATED * error <= asked:
            return path, True
    return path, False


def _refined(first: _Run, excess: float) -> list[_Run]:
    """The first mesh of a steady flow and, where its error exceeds what is asked, the second, mostly the last."""
    if excess <= 1.0:
        return [first]
    before, gdim = order_of(first.scene).number, first.scene.gdim
    order, left = next_order(
        before, excess / AIM, gdim, highest_order(gdim, has_inertia(first.scene))
    )
    per_vertex, more = UNKNOWNS[gdim], max(1.0, left) ** (0.5 * gdim / order)
    unknowns = first.unknowns * per_vertex[order] / per_vertex[before] * more
    return [first, _Run(changed(first.scene, numerics={"order": order}), round(unknowns))]


def _balanced(first: _Run, known: KnownLaws, asked: float) -> tuple[list[_Run], bool]:
    """Runs in time made finer as the search will choose them until the error is small enough; whether it is."""
    path, trial = [first], _as_tried(first, known)
    while not (reaches := cast(float, trial.estimate) <= asked) and len(path) < next_mesh.MOST_RUNS:
        last = path[-1].scene
        wanted = next_mesh.refined(last, trial, AIM * asked / cast(float, trial.estimate))
        scene, kept = next_mesh.finer(last, wanted), wanted.keeps_mesh(order_of(last).number)
        path.append(_Run(scene, path[-1].unknowns if kept else counted(scene).unknowns))
        trial = _as_tried(path[-1], known)
    return path, reaches


def _as_tried(run: _Run, known: KnownLaws) -> Trial:
    """Trial expected of a run: the part of the step as by longer steps, the rest of the mesh."""
    scene, of = run.scene, run.scene.accuracy_of
    own, in_longer = (known.errors(one.variant)[of].value for one in (run, _compared_with(run)[0]))
    of_step = min(shares(scene)[0] * abs(in_longer - own), own)
    return Trial(
        order_of(scene).number, 0, run.unknowns, own, 0.0, of_step=of_step, of_mesh=own - of_step
    )


def _compared_with(run: _Run) -> list[_Run]:
    """The runs in longer steps, the second in elements of one order more, that one in time is compared with."""
    longer, beside = comparisons(run.scene)
    return [_Run(longer, run.unknowns), _Run(beside, round(OTHER_ORDER * run.unknowns))]
