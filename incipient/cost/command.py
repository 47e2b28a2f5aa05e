"""The commands `incipient cost` and `incipient calibrate`, and what `incipient plan` predicts. None is collective."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import ConvergenceError, SceneError
from ..files import reported
from . import calibration
from . import page as cost_page
from .ladder import Spread, ladder, spread
from .rung import measure
from .study import Study, climb

if TYPE_CHECKING:
    from ..plan import Plan
    from ..scene import Scene

Say = Callable[[str], None]


def study(scene: Scene, directory: Path, wanted: Spread, say: Say) -> Study:
    """Make a scene's study in a directory, or finish the one there, and keep it in the calibration.

    Raises:
        IncipientError: the scene, the directory, or too many runs are at fault.
    """
    found = climb(scene, ladder(scene, wanted), directory, measure, say)
    cost_page.write(found, directory)
    cost_page.keep(found)
    return found


def chosen(scene: Scene, quick: bool, **lists: Sequence[float] | None) -> Spread:
    """The usual ladder of a scene with the orders, sizes and steps that were asked for.

    Raises:
        SceneError: a list is of no use.
    """
    usual = spread(scene, quick)
    if lists.get("steps") and scene.time is None:
        raise SceneError("--steps: the scene is steady; leave it out")
    given = {name: tuple(values) for name, values in lists.items() if values is not None}
    return Spread(**{**vars(usual), **given})


def told(found: Study, directory: Path) -> str:
    """The study in a few lines for a reader."""
    lines = [f"{'accuracy':<20}{found.words()}"]
    lines += [f"{'failed':<20}{run.rung.name}: {run.failed}" for run in found.failed]
    lines.append(f"{'numbers':<20}{directory}/: cost.md, cost.csv, cost.json, cost.png")
    return "\n".join(lines)


def predicted(scene: Scene, plan: Plan) -> tuple[dict[str, Any] | None, str]:
    """What a run will take and how accurate it will be, as plain data and in words; None without a calibration."""
    from ..files import plain
    from .prediction import predict, uncalibrated

    assert plan.estimate is not None
    found = predict(scene, plan.estimate)
    if found is None:
        return None, uncalibrated()
    first = "\n  that is of the first mesh; numerics.accuracy will choose others"
    return plain(found), found.text() + (first if scene.numerics.accuracy is not None else "")


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
