"""The commands `incipient cost` and `incipient calibrate`, and what `incipient plan` predicts. None is collective."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..accuracy.errorbars import coarse_scenes
from ..accuracy.first_mesh import first_mesh
from ..effects.plan import make_plan
from ..errors import ConvergenceError, MissingError, SceneError
from ..files import plain, reported
from ..planning.flow_setup import order_of
from ..planning.plan import Plan
from ..scene import Scene, load
from ..scene.example import grain_on_bed
from . import calibration, markdown
from .comparison import Compared
from .frontier import percent
from .ladder import Spread, ladder, spread
from .measurement import measure, quicker
from .prediction import Prediction, known_laws, predict
from .solvers import SolverOptions
from .study import Say, Study, findings, run_ladder

# Built-in scenes besides that of the example, in files.
BUILTIN = Path(__file__).with_name("builtin")
OF_EACH_KIND = (
    *("driven cavity", "turbulent channel", "channel resolved to the wall"),
    *("grain held in a starting flow", "grain carried by shear"),
)
# How many times as long runs below a free surface took with their error bars, the least and the most (docs/surface.md).
WITH_BARS = 1.3, 5.3
UNKNOWN = (
    "  time and errors are not known of scenes of this kind; they are after `incipient cost SCENE`"
)


def study(scene: Scene, directory: Path, wanted: Spread, say: Say) -> Study:
    """Make a scene's study in a directory, or finish the one there, and keep it in the calibration.

    Raises:
        IncipientError: the scene, the directory, or too many runs are at fault.
    """
    runs = ladder(scene, wanted)
    found = run_ladder(scene, runs, directory, quicker if runs.compared else measure, say)
    markdown.write(found, directory)
    calibration.add(findings(found))
    return found


def chosen(scene: Scene, quick: bool, **lists: Sequence[Any] | None) -> Spread:
    """The orders, sizes, steps and solver options of a ladder, as given or usual; raises SceneError for a bad list."""
    usual = spread(scene, quick)
    if lists.get("steps") and scene.time is None:
        raise SceneError("--steps: the scene is steady; leave it out")
    given = {name: tuple(values) for name, values in lists.items() if values is not None}
    if "solvers" in given:
        given["solvers"] = SolverOptions(scene).named(given["solvers"])
    return Spread(**{**vars(usual), **given})


def summary(found: Study, directory: Path) -> str:
    """The study in a few lines for a reader."""
    failed = [f"{'failed':<20}{run.variant.name}: {run.failed}" for run in found.failed]
    numbers = f"{'numbers':<20}{directory}/: cost.md, cost.csv, cost.json"
    lines = [
        f"{'accuracy':<20}{found.words()}",
        *map(_of_solver, found.solvers()),
        *failed,
        numbers,
    ]
    return "\n".join(lines)


def _of_solver(one: Compared) -> str:
    error = "no other error is known" if one.error is None else f"error x {one.error:.2g}"
    at_error = (
        "" if one.time_at_error is None else f", time at equal errors x {one.time_at_error:.2g}"
    )
    better = ": cheaper than the scene's own" if one.cheaper else ""
    change = f"change {percent(one.change)}"
    return f"{'solver':<20}{one.solver}: time x {one.time:.2g}, {error}, {change}{at_error}{better}"


@dataclass(frozen=True)
class PredictedPlan:
    """A plan, what the run will come to or in words why that is not known, and solver options that are cheaper.

    price: of error bars, in words; empty where it is not known
    """

    plan: Plan
    prediction: Prediction | str
    cheaper: tuple[str, ...] = ()
    price: str = ""

    def to_dict(self) -> dict[str, Any]:
        """Plain data; what is known in words alone is None."""
        prediction = None if isinstance(self.prediction, str) else plain(self.prediction)
        more = {"prediction": prediction, "cheaper": list(self.cheaper), "price": self.price}
        return self.plan.to_dict() | more

    def text(self) -> str:
        """A few lines for a reader."""
        words = self.prediction if isinstance(self.prediction, str) else self.prediction.text()
        ways = [f"  {way}" for way in (self.price, *self.cheaper) if way]
        return "\n".join([self.plan.text(), words, *ways])


def predicted_plan(scene: Scene, directory: Path | None = None) -> PredictedPlan:
    """The plan with what the run needs and will come to, by making its mesh, the first one if there are several.

    Without gmsh there is a plan all the same, with the reason why the rest is not known. The directory is that of a
    study to predict by; None: this machine's calibration. Raises MeshError, and OutputError where there is no study.
    """
    plan = make_plan(scene)
    known = known_laws(scene, directory)
    cheaper = () if known is None else tuple(known.cheaper())
    try:
        estimated = first_mesh(scene)
        expected = UNKNOWN if known is None else predict(known, estimated)
        plan = plan.with_estimate(estimated)
    except MissingError as error:
        expected = f"  cells, unknowns, memory and time are not known: {error}"
    return PredictedPlan(plan, expected, cheaper, price_of_bars(scene))


def price_of_bars(scene: Scene) -> str:
    """Price of the error bars of a free surface without a grain, in words; else empty. Not collective."""
    wanted = scene.numerics.error_bars and scene.numerics.accuracy is None
    if not wanted or scene.body is not None or not scene.has_surface:
        return ""
    runs = [
        (run.time, order_of(run).number) for run in coarse_scenes(scene) if run.time is not None
    ]
    named = ", ".join(f"P{order}-P{order - 1} in steps of {time.step:.3g}" for time, order in runs)
    least, most = WITH_BARS
    return (
        f"error bars take {len(runs)} more runs to the same end ({named}): with them runs below a free surface took "
        f"{least:g} to {most:g} times as long; numerics.error_bars = false leaves them out"
    )


def calibrate(say: Say) -> str:
    """Measure small built-in scenes of each kind; returns the findings in a line. Resumes if interrupted.

    Raises OutputError if the cache directory cannot be written, ConvergenceError if no scene could be run.
    """
    directory, failed = calibration.path().parent / "calibration", []
    scenes = builtin()
    for name, scene in scenes.items():
        say(f"{name}:")
        try:
            study(scene, directory / name, spread(scene, quick=True), say)
        except (ConvergenceError, SceneError) as error:
            failed.append(f"{name}: {error}")
    if len(failed) == len(scenes):
        raise ConvergenceError(f"calibrate: no scene could be run: {failed[0]}")
    with reported(directory):
        shutil.rmtree(directory)
    scenes_known = len(calibration.read())
    return "\n".join([f"{'calibration':<20}{calibration.path()}: {scenes_known} scenes", *failed])


def builtin() -> dict[str, Scene]:
    """A scene of each kind that takes a second or two, by name."""
    found = {name: load(BUILTIN / f"{name.replace(' ', '_')}.toml") for name in OF_EACH_KIND}
    return {"grain on a bed": grain_on_bed(), **found}
