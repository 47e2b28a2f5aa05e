"""The options of all commands, and their common checks."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..errors import SceneError
from ..parallel import Comm

BESIDE = object()  # directory option without a value: that of the case
OF_SWEEPS = ("quantity", "against", "by")  # options of `show` for sweeps only


def overrides(parser: argparse.ArgumentParser, example: str) -> None:
    """Add `--set`, with an example in its help."""
    repeated: dict[str, Any] = {"dest": "overrides", "action": "append", "default": []}
    parser.add_argument(
        "--set", metavar="KEY=VALUE", help=f"change a key, as in {example}", **repeated
    )


def named(text: str) -> Path:
    """A nonempty path: an empty one would be the working directory."""
    if not text.strip():
        raise argparse.ArgumentTypeError("the name is empty; give the name of a directory or file")
    return Path(text)


def alone(name: str, comm: Comm) -> None:
    """Refuse several ranks for a command that starts processes."""
    if comm.size > 1:
        raise SceneError(f"{name} starts processes of its own; call it without mpirun")


def require_left_by(directory: Path, names: Sequence[str]) -> None:
    """Raise SceneError for a directory without files of an earlier command."""
    if not any((directory / name).is_file() for name in names):
        there = directory.is_dir()
        why = "is not the directory of a run" if there else "there is no such directory"
        raise SceneError(f"{directory}: {why}; give the directory that a run was written to")


def no_options(parser: argparse.ArgumentParser) -> None:
    """Add no options."""


def _scene(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("scene", type=Path, help="scene file (TOML)")
    overrides(parser, "fluid.reynolds=40")


def _scene_to(parser: argparse.ArgumentParser, ending: str = "", what: str = "results") -> None:
    _scene(parser)
    usual = f"results/NAME OF THE SCENE{ending}"
    parser.add_argument("--out", type=named, help=f"directory for the {what} (default: {usual})")


def _details(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--verbose",
        "-v",
        action="store_true",
        help="also print the plan, the estimates of errors, parts of forces and the cost of effects",
    )


def of_run(parser: argparse.ArgumentParser) -> None:
    """Options of `run`."""
    _scene_to(parser)
    parser.add_argument(
        "--overwrite",
        action="store_true",
        help="remove an earlier run from the directory even if it can be resumed (default: move it to a numbered one)",
    )
    _details(parser)


def of_resume(parser: argparse.ArgumentParser) -> None:
    """Options of `resume`."""
    parser.add_argument("directory", type=Path, help="directory of the run")
    overrides(parser, "time.end=20")
    _details(parser)


def of_threshold(parser: argparse.ArgumentParser) -> None:
    """Options of `threshold`."""
    _scene_to(parser, "_threshold")


def of_gust(parser: argparse.ArgumentParser) -> None:
    """Options of `gust`."""
    _scene_to(parser, "_gusts")
    parser.add_argument(
        "--durations",
        type=float,
        nargs="+",
        default=[0.5, 1.0, 2.0, 4.0, 8.0],
        metavar="TIME",
        help="durations of the gusts, in units of the scene (default: 0.5 1 2 4 8)",
    )


def of_entrainment(parser: argparse.ArgumentParser) -> None:
    """Options of `entrainment`."""
    add = parser.add_argument
    _scene_to(parser, "_entrainment")
    usual = "0.001 0.01 0.05 0.5, as far as data resolve them"
    add(
        "--probabilities",
        type=float,
        nargs="+",
        default=[],
        metavar="P",
        help=f"of motion at an instant, for which the Shields number is computed (default: {usual})",
    )
    add(
        "--strengths",
        type=float,
        nargs="+",
        default=[],
        metavar="FACTOR",
        help="mean flows of the curve, as multiples of the scene's (default: automatic)",
    )
    add(
        "--gusts",
        type=named,
        metavar="DIRECTORY",
        help="results of incipient gust: also compute how often gusts last long enough",
    )
    add(
        "--data",
        type=named,
        metavar="FILE",
        help="CSV of measured Shields numbers and probabilities, for the picture",
    )


def of_plan(parser: argparse.ArgumentParser) -> None:
    """Options of `plan`."""
    _scene(parser)
    parser.add_argument("--json", action="store_true", help="as JSON")


def of_cost(parser: argparse.ArgumentParser) -> None:
    """Options of `cost`."""
    add = parser.add_argument
    _scene_to(parser, "_cost", "study")
    add("--do", choices=("run", "threshold"), default="run", help="what to run (default: run)")
    add("--quick", action="store_true", help="the scene's own order, coarser cells and steps only")
    add("--orders", type=int, nargs="+", metavar="ORDER", help="orders of the velocity, 2 to 4")
    for name, what in (("--sizes", "cell sizes"), ("--steps", "time steps")):
        text = f"{what} as multiples of the scene's"
        add(name, type=float, nargs="+", metavar="FACTOR", help=text)
    add(
        "--exact",
        nargs="+",
        default=[],
        metavar="NAME=VALUE",
        help="exact values, such as force_x=9.42, to compare with (default: the finest run)",
    )


def of_show(parser: argparse.ArgumentParser) -> None:
    """Options of `show`."""
    add = parser.add_argument
    add("directory", type=Path, help="directory of the results, or the file of a sweep")
    add("--quantity", metavar="COLUMN", help="of a sweep: what to draw (see incipient table)")
    add(
        "--against",
        metavar="COLUMN",
        help="of a sweep: the abscissa (default: the first varied key)",
    )
    add("--by", metavar="COLUMN", help="of a sweep: the column with a curve for each value")
    add("--animate", action="store_true", help="write an animation of the flow instead")
    add("--out", type=named, metavar="FILE", help="file of the animation, .gif or .mp4")
    fields = ("velocity", "pressure", "vorticity")
    add("--field", choices=fields, help="what to animate (default: velocity)")


def of_report(parser: argparse.ArgumentParser) -> None:
    """Options of `report`."""
    parser.add_argument("path", type=Path, help="directory of the results, or the file of a sweep")
    parser.add_argument(
        "--out",
        type=named,
        metavar="FILE",
        help="file of the page (default: report.html in the directory, or next to the sweep)",
    )


def of_sweep(parser: argparse.ArgumentParser) -> None:
    """Options of `sweep`."""
    add = parser.add_argument
    add(
        "scenes",
        type=Path,
        nargs="+",
        metavar="SCENE",
        help="scene files, or cases to judge (TOML)",
    )
    add(
        "--over",
        action="append",
        default=[],
        metavar="KEY=VALUES",
        help="as in fluid.reynolds=log:0.1:200:17 or contact.friction=0.2,0.4; repeat it for all combinations",
    )
    add("--zip", action="store_true", help="combine the values of several keys one by one instead")
    add(
        "--cases",
        type=Path,
        metavar="FILE.csv",
        help="keys in the first row, a case in each other row",
    )
    add(
        "--refine",
        type=_share,
        nargs="?",
        const=True,
        metavar="FRACTION",
        help="add cases where the mode changes or the curve bends, to this fraction of the range (default: 0.02)",
    )
    add(
        "--most",
        type=int,
        metavar="N",
        help="with --refine: largest number of cases (default: 1000)",
    )
    add(
        "--quantity",
        metavar="COLUMN",
        help="with --refine: the column whose curve is refined (see incipient table)",
    )
    overrides(parser, "numerics.mesh_size=2")
    add(
        "--do",
        choices=("run", "threshold", "gust", "entrainment", "judge"),
        help="what to compute for each case (default: run)",
    )
    add(
        "--out",
        type=named,
        metavar="FILE",
        help="file of the sweep (default: results/SCENE_TASK.sqlite)",
    )
    _workers(parser, "case")
    add(
        "--memory",
        type=float,
        metavar="MIB",
        help="memory of each case (default: 4/5 of the free memory, divided by concurrent cases)",
    )
    add(
        "--tries",
        type=int,
        default=3,
        metavar="N",
        help="attempts at a case whose worker process dies (default: 3)",
    )
    add("--dry-run", action="store_true", help="check the cases and count those to compute")


def of_survey(parser: argparse.ArgumentParser) -> None:
    """Options of `survey`."""
    add = parser.add_argument
    add("bed", type=Path, help="survey file (TOML); with --orientations or --seeds a 3-D scene")
    overrides(parser, "bed.seed=2")
    add(
        "--out",
        type=named,
        help="directory for the results (default: results/NAME OF THE FILE_survey)",
    )
    add(
        "--runs",
        type=int,
        default=0,
        metavar="N",
        help="add this many full runs, of grains with the largest predictive variance (default: runs.number in all)",
    )
    add(
        "--orientations",
        type=int,
        metavar="N",
        help="find the thresholds of a scene's grain in this many random orientations, the first being its own",
    )
    add("--seeds", type=int, metavar="N", help="compute its thresholds on this many random beds")
    _workers(parser, "run")


def _workers(parser: argparse.ArgumentParser, what: str) -> None:
    add = parser.add_argument
    add(
        "--jobs",
        "-n",
        type=int,
        metavar="N",
        help=f"{what}s at a time on this machine (default: one a core)",
    )
    add(
        "--scheduler",
        metavar="ADDRESS",
        help="workers of Dask: tcp://HOST:PORT of its scheduler, or its file FILE.json",
    )
    add("--limit", metavar="TIME", help=f"time that a {what} may take, such as 2h (default: a day)")
    add(
        "--wall",
        metavar="TIME",
        help="time after which to stop, such as 8h or 1h30m; the same command resumes",
    )
    add("--retry", action="store_true", help=f"compute failed {what}s again")
    for old in ("--executor", "--ranks"):
        add(old, help=argparse.SUPPRESS)


def refuse_old_workers(options: argparse.Namespace) -> None:
    """Raise SceneError for retired options of sweeps."""
    if options.executor is not None:
        address = options.executor.replace("dask://", "tcp://")
        raise SceneError(f"--executor: is now --scheduler; write --scheduler {address}")
    if options.ranks is not None:
        remedy = "leave it out, or give `mpirun incipient run` for a large flow"
        raise SceneError(f"--ranks: a sweep computes each case on one rank; {remedy}")


def _share(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(
            f"{text} is not a number; give 0.01, or put --refine last"
        ) from None


def of_table(parser: argparse.ArgumentParser) -> None:
    """Options of `table`."""
    parser.add_argument(
        "file", type=Path, help="file of a sweep; for size classes also grains.csv of a survey"
    )
    parser.add_argument(
        "--size",
        metavar="COLUMN",
        help="with --size-classes: column of sizes (default: diameter, or body.diameter)",
    )
    ways = parser.add_mutually_exclusive_group()
    ways.add_argument("--csv", action="store_true", help="all columns, as CSV")
    ways.add_argument("--parquet", type=named, metavar="FILE", help="write all columns there")
    ways.add_argument(
        "--size-classes",
        type=_numbers,
        metavar="BOUNDS",
        help="critical Shields numbers by size class, as CSV: bounds of the classes, as in 0.5,1,2",
    )


def _numbers(text: str) -> list[float]:
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        raise argparse.ArgumentTypeError(
            f"{text} is not a list of numbers; give bounds, as in 0.5,1,2"
        ) from None


def of_judge(parser: argparse.ArgumentParser) -> None:
    """Options of `judge`."""
    add = parser.add_argument
    add(
        "case",
        type=Path,
        nargs="?",
        help="case file (TOML): load and contacts; with --forces or --series contacts alone",
    )
    ways = parser.add_mutually_exclusive_group()
    ways.add_argument(
        "--forces",
        type=named,
        metavar="PATH",
        help="judge forces of an OpenFOAM run: folder of its function object forces, or force.dat or forces.dat",
    )
    add(
        "--density",
        type=float,
        metavar="RATIO",
        help="with --forces: density of the fluid over the rhoInf that they were computed with",
    )
    add(
        "--grain",
        type=named,
        metavar="FILE",
        help="with --forces, instead of a case: STL, PLY or OBJ file of the grain, in the coordinates of that run",
    )
    add(
        "--bed",
        type=named,
        metavar="FILE",
        help="STL, PLY or OBJ file of the bed; flat: a plane below the grain",
    )
    ways.add_argument(
        "--series",
        type=named,
        metavar="FILE",
        help="judge a series of loads: .csv or .parquet with time, force_x, force_y, couple (docs/howto/forces.md)",
    )
    add(
        "--since",
        type=float,
        metavar="TIME",
        help="with --forces or --series: start of the samples (default: all; for the mean, the last half)",
    )
    add(
        "--law",
        choices=("U", "U2"),
        help="with --forces or --series: loads scale with velocity, U, or its square, U2; adds the critical velocity",
    )
    ways.add_argument(
        "--batch",
        type=named,
        metavar="FILE",
        help="judge a table of cases, one a row: .csv or .parquet (docs/howto/forces.md)",
    )
    add("--jobs", type=int, metavar="N", help="with --batch: threads (default: one for each core)")
    overrides(parser, "contacts.friction=0.4")
    add(
        "--out",
        nargs="?",
        type=named,
        const=BESIDE,
        metavar="DIRECTORY",
        help=(
            "write judgement.json and its picture there; without a DIRECTORY next to the case or table"
        ),
    )


def _length(text: str) -> float:
    from .flume import length  # its libraries are not needed by other commands

    return length(text)


def of_flume(parser: argparse.ArgumentParser) -> None:
    """Options of `flume`."""
    parser.add_argument(
        "--diameter", type=_length, required=True, help="of the grains, as in 2mm or 0.002 [m]"
    )
    parser.add_argument(
        "--density",
        type=float,
        default=2650.0,
        help="of the grains [kg/m3] (default: quartz, 2650)",
    )
    parser.add_argument(
        "--shear-velocity", type=float, help="u* [m/s]; or depth and velocity, or depth and slope"
    )
    parser.add_argument("--depth", type=_length, help="of the flow, as in 0.3m")
    parser.add_argument("--velocity", type=float, help="mean over the depth [m/s]")
    parser.add_argument("--slope", type=float, help="of bed and surface, rise over length")
    parser.add_argument(
        "--temperature", type=float, default=20.0, help="of the water [°C] (default: 20)"
    )
    parser.add_argument("--viscosity", type=float, help="kinematic, of another fluid [m2/s]")
    parser.add_argument("--fluid-density", type=float, help="of another fluid [kg/m3]")
    parser.add_argument("--gravity", type=float, default=9.81, help="[m/s2] (default: 9.81)")
    parser.add_argument(
        "--scene", type=named, metavar="FILE", help="write a scene of one such grain"
    )
    parser.add_argument(
        "--curve", type=named, metavar="FILE.png", help="draw the point in Shields' diagram"
    )
    parser.add_argument("--json", action="store_true", help="print the numbers as JSON")


def of_new(parser: argparse.ArgumentParser) -> None:
    """Options of `new`."""
    parser.add_argument("name", help="name of the scene; NAME.toml is written")
    parser.add_argument("--space", action="store_true", help="write a 3-D scene")
