"""The commands and their options."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import SceneError

BESIDE = object()  # directory option without a value: that of the case
OF_SWEEPS = ("quantity", "against", "by")  # options of `show` for sweeps only
_OWN = ("ways", "needs")  # keywords: options of which one may be given; those that one needs


@dataclass(frozen=True)
class Command:
    """A command: what it does, the module of its function, and the arguments of `add_argument`.

    on_first: the first rank runs it alone.
    """

    text: str
    module: str
    options: Sequence[tuple[tuple[str, ...], dict[str, Any]]] = ()
    on_first: bool = False

    def add_options(self, parser: argparse.ArgumentParser) -> None:
        ways = None
        for names, keywords in self.options:
            adder: Any = parser
            if keywords.get("ways"):
                adder = ways = ways or parser.add_mutually_exclusive_group()
            adder.add_argument(*names, **{k: v for k, v in keywords.items() if k not in _OWN})

    def check(self, chosen: argparse.Namespace) -> None:
        """Raise SceneError for an option without one that it needs."""
        for (name, *_), keywords in self.options:
            needs = keywords.get("needs", ())
            is_set = needs and getattr(chosen, name.lstrip("-")) is not None
            if is_set and not any(getattr(chosen, other) for other in needs):
                others = " or ".join(f"--{other}" for other in needs)
                raise SceneError(f"{name}: needs {others}; add it, or leave {name} out")


def require_left_by(directory: Path, names: Sequence[str]) -> None:
    """Raise SceneError for a directory without files of an earlier command."""
    if not any((directory / name).is_file() for name in names):
        there = directory.is_dir()
        why = "is not the directory of a run" if there else "there is no such directory"
        raise SceneError(f"{directory}: {why}; give the directory that a run was written to")


# -- values of options -----------------------------------------------------------------------------


def _named(text: str) -> Path:
    """A nonempty path: an empty one would be the working directory."""
    if not text.strip():
        raise argparse.ArgumentTypeError("the name is empty; give the name of a directory or file")
    return Path(text)


def _parsed(parse: Callable[[str], Any], what: str) -> Callable[[str], Any]:
    def parsed(text: str) -> Any:
        try:
            return parse(text)
        except ValueError:
            raise argparse.ArgumentTypeError(f"{text} is not {what}") from None

    return parsed


def _retired(remedy: str) -> Callable[[str], Any]:
    def refuse(text: str) -> Any:
        raise argparse.ArgumentTypeError(remedy.format(text.replace("dask://", "tcp://")))

    return refuse


def _length(text: str) -> float:
    from .flume import length  # its libraries are not needed by other commands

    return length(text)


# -- the table -------------------------------------------------------------------------------------


def _option(*names: str, **keywords: Any) -> tuple[tuple[str, ...], dict[str, Any]]:
    return names, keywords


def _set(example: str) -> tuple[tuple[str, ...], dict[str, Any]]:
    text = f"change a key, as in {example}"
    return _option(
        "--set", dest="overrides", action="append", default=[], metavar="KEY=VALUE", help=text
    )


def _scene_to(ending: str = "", what: str = "results") -> tuple[Any, ...]:
    usual = f"results/NAME OF THE SCENE{ending}"
    return (
        *_SCENE,
        _option("--out", type=_named, help=f"directory for the {what} (default: {usual})"),
    )


def _workers(what: str) -> tuple[Any, ...]:
    return (
        _option("--jobs", "-n", type=int, metavar="N",
                help=f"{what}s at a time on this machine (default: one a core)"),
        _option("--scheduler", metavar="ADDRESS",
                help="workers of Dask: tcp://HOST:PORT of its scheduler, or its file FILE.json"),
        _option("--limit", metavar="TIME", help=f"time that a {what} may take, such as 2h (default: a day)"),
        _option("--wall", metavar="TIME",
                help="time after which to stop, such as 8h or 1h30m; the same command resumes"),
        _option("--retry", action="store_true", help=f"compute failed {what}s again"),
        _option("--executor", help=argparse.SUPPRESS,
                type=_retired("is now --scheduler; write --scheduler {}")),
        _option("--ranks", help=argparse.SUPPRESS,
                type=_retired("a sweep computes each case on one rank; leave it out, or give "
                              "`mpirun incipient run` for a large flow")),
    )  # fmt: skip


_SCENE = (_option("scene", type=Path, help="scene file (TOML)"), _set("fluid.reynolds=40"))
_DETAILS = _option(
    "--verbose", "-v", action="store_true",
    help="also print the plan, the estimates of errors, parts of forces and the cost of effects",
)  # fmt: skip
_OF_RESULTS = "directory of the results, or the file of a sweep"

COMMANDS = {
    "flume": Command("say whether a bed of grains moves, from published thresholds", "flume", (
        _option("--diameter", type=_length, required=True, help="of the grains, as in 2mm or 0.002 [m]"),
        _option("--density", type=float, default=2650.0, help="of the grains [kg/m3] (default: quartz, 2650)"),
        _option("--shear-velocity", type=float, help="u* [m/s]; or depth and velocity, or depth and slope"),
        _option("--depth", type=_length, help="of the flow, as in 0.3m"),
        _option("--velocity", type=float, help="mean over the depth [m/s]"),
        _option("--slope", type=float, help="of bed and surface, rise over length"),
        _option("--temperature", type=float, default=20.0, help="of the water [°C] (default: 20)"),
        _option("--viscosity", type=float, help="kinematic, of another fluid [m2/s]"),
        _option("--fluid-density", type=float, help="of another fluid [kg/m3]"),
        _option("--gravity", type=float, default=9.81, help="[m/s2] (default: 9.81)"),
        _option("--scene", type=_named, metavar="FILE", help="write a scene of one such grain"),
        _option("--curve", type=_named, metavar="FILE.png", help="draw the point in Shields' diagram"),
        _option("--json", action="store_true", help="print the numbers as JSON"),
    ), on_first=True),
    "run": Command("simulate a scene and judge its grain (also under mpirun)", "runs", (
        *_scene_to(),
        _option("--overwrite", action="store_true",
                help="remove an earlier run from the directory even if it can be resumed "
                     "(default: move it to a numbered one)"),
        _DETAILS,
    )),
    "resume": Command("continue a run that was cut short (also under mpirun)", "runs", (
        _option("directory", type=Path, help="directory of the run"), _set("time.end=20"), _DETAILS,
    )),
    "threshold": Command(
        "compute the flow at which the scene's grain first moves", "runs", _scene_to("_threshold")),
    "gust": Command("compute the weakest gusts that move the grain out of its pocket", "runs", (
        *_scene_to("_gusts"),
        _option("--durations", type=float, nargs="+", default=[0.5, 1.0, 2.0, 4.0, 8.0], metavar="TIME",
                help="durations of the gusts, in units of the scene (default: 0.5 1 2 4 8)"),
    )),
    "entrainment": Command("compute the probability of motion in a fluctuating flow", "runs", (
        *_scene_to("_entrainment"),
        _option("--probabilities", type=float, nargs="+", default=[], metavar="P",
                help="of motion at an instant, for which the Shields number is computed (default: 0.001 0.01 "
                     "0.05 0.5, as far as data resolve them)"),
        _option("--strengths", type=float, nargs="+", default=[], metavar="FACTOR",
                help="mean flows of the curve, as multiples of the scene's (default: automatic)"),
        _option("--gusts", type=_named, metavar="DIRECTORY",
                help="results of incipient gust: also compute how often gusts last long enough"),
        _option("--data", type=_named, metavar="FILE",
                help="CSV of measured Shields numbers and probabilities, for the picture"),
    )),
    "plan": Command("show models, mesh size and cost of a run without solving", "costs", (
        *_SCENE, _option("--json", action="store_true", help="as JSON"),
    )),
    "cost": Command("measure error against time on a ladder of meshes, orders and steps", "costs", (
        *_scene_to("_cost", "study"),
        _option("--do", choices=("run", "threshold"), default="run", help="what to run (default: run)"),
        _option("--quick", action="store_true", help="the scene's own order, coarser cells and steps only"),
        _option("--orders", type=int, nargs="+", metavar="ORDER", help="orders of the velocity, 2 to 4"),
        _option("--sizes", type=float, nargs="+", metavar="FACTOR", help="cell sizes as multiples of the scene's"),
        _option("--steps", type=float, nargs="+", metavar="FACTOR", help="time steps as multiples of the scene's"),
        _option("--exact", help=argparse.SUPPRESS,
                type=_retired("is retired; compare the columns of cost.csv with exact values")),
    )),
    "show": Command("draw the pictures of a finished run, or animate its flow", "showing", (
        _option("directory", type=Path, help=_OF_RESULTS),
        _option("--quantity", metavar="COLUMN", help="of a sweep: what to draw (see incipient table)"),
        _option("--against", metavar="COLUMN",
                help="of a sweep: the abscissa (default: the first varied key)"),
        _option("--by", metavar="COLUMN", help="of a sweep: the column with a curve for each value"),
        _option("--animate", action="store_true", help="write an animation of the flow instead"),
        _option("--out", type=_named, metavar="FILE", needs=("animate",), help="file of the animation, .gif or .mp4"),
        _option("--field", choices=("velocity", "pressure", "vorticity"), needs=("animate",),
                help="what to animate (default: velocity)"),
    ), on_first=True),
    "report": Command("write the results as one HTML page", "showing", (
        _option("path", type=Path, help=_OF_RESULTS),
        _option("--out", type=_named, metavar="FILE",
                help="file of the page (default: report.html in the directory, or next to the sweep)"),
    ), on_first=True),
    "sweep": Command("run or judge many cases, or compute their thresholds", "sweep", (
        _option("scenes", type=Path, nargs="+", metavar="SCENE", help="scene files, or cases to judge (TOML)"),
        _option("--over", action="append", default=[], metavar="KEY=VALUES",
                help="as in fluid.reynolds=log:0.1:200:17 or contact.friction=0.2,0.4; repeat it for all "
                     "combinations"),
        _option("--zip", action="store_true", help="combine the values of several keys one by one instead"),
        _option("--cases", type=Path, metavar="FILE.csv",
                help="keys in the first row, a case in each other row"),
        _option("--refine", type=_parsed(float, "a number; give 0.01, or put --refine last"), nargs="?",
                const=True, metavar="FRACTION",
                help="add cases where the mode changes or the curve bends, to this fraction of the range "
                     "(default: 0.02)"),
        _option("--most", type=int, metavar="N",
                help="with --refine: largest number of cases (default: 1000)"),
        _option("--quantity", metavar="COLUMN",
                help="with --refine: the column whose curve is refined (see incipient table)"),
        _set("numerics.mesh_size=2"),
        _option("--do", choices=("run", "threshold", "gust", "entrainment", "judge"),
                help="what to compute for each case (default: run)"),
        _option("--out", type=_named, metavar="FILE",
                help="file of the sweep (default: results/SCENE_TASK.sqlite)"),
        *_workers("case"),
        _option("--memory", type=float, metavar="MIB",
                help="memory of each case (default: 4/5 of the free memory, divided by concurrent cases)"),
        _option("--tries", type=int, default=3, metavar="N",
                help="attempts at a case whose worker process dies (default: 3)"),
        _option("--dry-run", action="store_true", help="check the cases and count those to compute"),
    )),
    "survey": Command("compute the thresholds of the exposed grains of a bed", "survey", (
        _option("bed", type=Path, help="survey file (TOML); with --orientations or --seeds a 3-D scene"),
        _set("bed.seed=2"),
        _option("--out", type=_named,
                help="directory for the results (default: results/NAME OF THE FILE_survey)"),
        _option("--runs", type=int, default=0, metavar="N",
                help="add this many full runs to runs.number, each of the grain least like the others"),
        _option("--orientations", type=int, metavar="N",
                help="find the thresholds of a scene's grain in this many random orientations, the first being "
                     "its own"),
        _option("--seeds", type=int, metavar="N", help="compute its thresholds on this many random beds"),
        *_workers("run"),
    )),
    "table": Command("print the results of a sweep, a row for each case", "sweep", (
        _option("file", type=Path, help="file of a sweep; for size classes also grains.csv of a survey"),
        _option("--size", metavar="COLUMN",
                help="with --size-classes: column of sizes (default: diameter, or body.diameter)"),
        _option("--csv", ways=True, action="store_true", help="all columns, as CSV"),
        _option("--parquet", help=argparse.SUPPRESS,
                type=_retired("is retired; in Python use incipient.sweep.frame(FILE).to_parquet({!r})")),
        _option("--size-classes", ways=True, metavar="BOUNDS",
                type=_parsed(lambda text: [float(part) for part in text.split(",")],
                             "a list of numbers; give bounds, as in 0.5,1,2"),
                help="critical Shields numbers by size class, as CSV: bounds of the classes, as in 0.5,1,2"),
    ), on_first=True),
    "judge": Command("judge forces from another program or a measurement", "judge", (
        _option("case", type=Path, nargs="?",
                help="case file (TOML): load and contacts; with --forces or --series contacts alone"),
        _option("--forces", ways=True, type=_named, metavar="PATH",
                help="judge forces of an OpenFOAM run: folder of its function object forces, or force.dat or "
                     "forces.dat"),
        _option("--density", type=float, metavar="RATIO", needs=("forces",),
                help="with --forces: density of the fluid over the rhoInf that they were computed with"),
        _option("--grain", type=_named, metavar="FILE", needs=("forces",),
                help="with --forces, instead of a case: STL, PLY or OBJ file of the grain, in the coordinates "
                     "of that run"),
        _option("--bed", type=_named, metavar="FILE", needs=("forces",),
                help="STL, PLY or OBJ file of the bed; flat: a plane below the grain"),
        _option("--series", ways=True, type=_named, metavar="FILE",
                help="judge a series of loads: .csv or .parquet with time, force_x, force_y, couple "
                     "(docs/howto/forces.md)"),
        _option("--since", type=float, metavar="TIME", needs=("forces", "series"),
                help="with --forces or --series: start of the samples (default: all; for the mean, the last "
                     "half)"),
        _option("--law", choices=("U", "U2"), needs=("forces", "series"),
                help="with --forces or --series: loads scale with velocity, U, or its square, U2; adds the "
                     "critical velocity"),
        _option("--batch", ways=True, type=_named, metavar="FILE",
                help="judge a table of cases, one a row: .csv or .parquet (docs/howto/forces.md)"),
        _option("--jobs", type=int, metavar="N", needs=("batch",),
                help="with --batch: threads (default: one for each core)"),
        _set("contacts.friction=0.4"),
        _option("--out", nargs="?", type=_named, const=BESIDE, metavar="DIRECTORY",
                help="write judgement.json and its picture there; without a DIRECTORY next to the case or "
                     "table"),
    ), on_first=True),
    "new": Command("write a commented example scene", "showing", (
        _option("name", help="name of the scene; NAME.toml is written"),
        _option("--space", action="store_true", help="write a 3-D scene"),
    ), on_first=True),
    "schema": Command("print the JSON schema of scenes, for editors", "showing", on_first=True),
}  # fmt: skip
RETIRED = {"calibrate": "`incipient cost SCENE` measures error against time for a scene of yours"}
