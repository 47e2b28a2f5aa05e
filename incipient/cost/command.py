"""The commands `incipient cost` and `incipient calibrate`, and what `incipient plan` predicts. None is collective."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import ConvergenceError, MissingError, SceneError
from ..files import reported
from . import calibration
from . import page as cost_page
from .comparison import Compared
from .frontier import percent
from .ladder import Spread, ladder, spread
from .measurement import measure, quickest
from .solvers import named
from .study import Study, climb

if TYPE_CHECKING:
    from ..planning.plan import Plan
    from ..scene import Scene

Say = Callable[[str], None]


def study(scene: Scene, directory: Path, wanted: Spread, say: Say) -> Study:
    """Make a scene's study in a directory, or finish the one there, and keep it in the calibration.

    Raises:
        IncipientError: the scene, the directory, or too many runs are at fault.
    """
    runs = ladder(scene, wanted)
    found = climb(scene, runs, directory, quickest if runs.compared else measure, say)
    cost_page.write(found, directory)
    cost_page.keep(found)
    return found


def chosen(scene: Scene, quick: bool, **lists: Sequence[Any] | None) -> Spread:
    """The usual ladder of a scene with the orders, sizes, steps and ways to solve that were asked for.

    Raises:
        SceneError: a list is of no use.
    """
    usual = spread(scene, quick)
    if lists.get("steps") and scene.time is None:
        raise SceneError("--steps: the scene is steady; leave it out")
    given = {name: tuple(values) for name, values in lists.items() if values is not None}
    if "solvers" in given:
        given["solvers"] = named(scene, given["solvers"])
    return Spread(**{**vars(usual), **given})


def told(found: Study, directory: Path) -> str:
    """The study in a few lines for a reader."""
    lines = [f"{'accuracy':<20}{found.words()}"]
    lines += [_told_of_solver(one) for one in found.solvers()]
    lines += [f"{'failed':<20}{run.rung.name}: {run.failed}" for run in found.failed]
    lines.append(f"{'numbers':<20}{directory}/: cost.md, cost.csv, cost.json")
    return "\n".join(lines)


def _told_of_solver(one: Compared) -> str:
    error = "no other error can be told" if one.error is None else f"error x {one.error:.2g}"
    better = ": better than the scene's own way" if one.dominates else ""
    return f"{'solver':<20}{one.solver}: time x {one.time:.2g}, {error}, change {percent(one.change)}{better}"


def planned(scene: Scene) -> Plan:
    """The plan with what the run needs, or the first one where it is asked for accuracy, by making that mesh.

    Raises:
        MeshError: it cannot be made.
    """
    from ..planning.plan import make_plan
    from ..simulation.build import estimate

    if scene.numerics.accuracy is None:
        return estimate(scene)
    from .forecast import first_mesh

    return make_plan(scene).with_estimate(first_mesh(scene))


def predicted(scene: Scene, plan: Plan) -> tuple[dict[str, Any] | None, str]:
    """What a run will take and how accurate it will be, as plain data and in words; None where it is not known.

    Args:
        plan: that of `planned`.

    Raises:
        MeshError: a coarse mesh for the error bars cannot be made.
    """
    from ..files import plain
    from .forecast import foresee
    from .prediction import predict, uncalibrated

    assert plan.estimate is not None
    if scene.numerics.accuracy is None:
        found = predict(scene, plan.estimate)
        return (None, uncalibrated()) if found is None else (plain(found), found.text())
    foreseen = foresee(scene, plan.estimate)
    return (None, foreseen) if isinstance(foreseen, str) else (plain(foreseen), foreseen.text())


def planned_and_predicted(scene: Scene) -> tuple[Plan, dict[str, Any] | None, str]:
    """`planned` and `predicted` together; without gmsh the plan is told all the same, with the reason for the rest.

    Raises:
        MeshError: a mesh cannot be made.
    """
    from ..planning.plan import make_plan

    try:
        plan = planned(scene)
        return plan, *predicted(scene, plan)
    except MissingError as error:
        return make_plan(scene), None, f"  cells, unknowns, memory and time are not known: {error}"


# -- calibration --------------------------------------------------------------------------------------------


def calibrate(say: Say) -> str:
    """Measure small built-in scenes of each kind; what was found in a line. Goes on where it was interrupted.

    Raises:
        OutputError: the cache directory cannot be written.
        ConvergenceError: no scene could be run.
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
    runs = len(calibration.read().runs)
    return "\n".join([f"{'calibration':<20}{calibration.path()}: {runs} runs", *failed])


def builtin() -> dict[str, Scene]:
    """A scene of each kind that takes a second or two."""
    from ..scene.example import grain_on_bed
    from ..scene.model import Disc, Domain, Fluid, Lid, Numerics, Scene, Shear, Time, Uniform

    bars = Numerics(error_bars=False)
    return {
        "grain on a bed": grain_on_bed(),
        "driven cavity": Scene(
            title="Driven cavity, Re = 400",
            domain=Domain(kind="box", length=1.0, height=1.0),
            fluid=Fluid(reynolds=400.0, scale="flow"),
            flow=Lid(),
            numerics=Numerics(order=4),
        ),
        "grain held in a started stream": Scene(
            title="Disc in a stream, Re = 40",
            domain=Domain(kind="channel", length=12.0, height=8.0),
            fluid=Fluid(reynolds=40.0, scale="grain"),
            flow=Uniform(),
            body=Disc(diameter=1.0, centre=(4.0, 4.0)),
            time=Time(end=2.0, step=0.025),
            numerics=bars,
        ),
        "grain carried by shear": Scene(
            title="Free disc in shear, Re = 10",
            domain=Domain(kind="channel", length=12.0, height=6.0),
            fluid=Fluid(reynolds=10.0, scale="grain"),
            flow=Shear(rate=1.0),
            body=Disc(diameter=1.0, centre=(4.0, 2.0), motion="free", density=1.0),
            time=Time(end=1.0, step=0.0125, start="stokes"),
            numerics=bars,
        ),
    }
