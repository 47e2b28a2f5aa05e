"""`incipient sweep`, `incipient table`, and `incipient show` of the file of a sweep."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Set
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import ConvergenceError, OutputError, SceneError
from .options import named, overrides

if TYPE_CHECKING:
    from mpi4py import MPI

    from ..sweep.procedure import SweepProgress
    from ..sweep.request import Request

WIDE = 160  # columns of a table that goes to a file
# Options of `show` that are for sweeps alone.
_OF_SHOW = ("quantity", "against", "by")


def options_of_sweep(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command."""
    parser.add_argument(
        "scenes", type=Path, nargs="+", metavar="SCENE", help="scene files, or cases to judge (TOML)"
    )
    parser.add_argument(
        "--over",
        action="append",
        default=[],
        metavar="KEY=VALUES",
        help="such as fluid.reynolds=log:0.1:200:17 or contact.friction=0.2,0.4; several: every combination",
    )
    parser.add_argument(
        "--zip", action="store_true", help="take the values of several keys side by side instead"
    )
    parser.add_argument(
        "--cases", type=Path, metavar="FILE.csv", help="a case a row, under the keys of the first row"
    )
    parser.add_argument(
        "--refine",
        type=_share,
        nargs="?",
        const=True,
        metavar="SHARE",
        help="add cases where the mode changes or the curve bends, to this share of the range (default: 0.02)",
    )
    parser.add_argument("--most", type=int, metavar="N", help="with --refine: cases in all (default: 1000)")
    parser.add_argument(
        "--quantity",
        metavar="COLUMN",
        help="with --refine: the column whose curve is to be known (see table)",
    )
    overrides(parser, "numerics.mesh_size=2")
    parser.add_argument("--do", choices=("run", "threshold", "judge"), help="(default: run)")
    parser.add_argument(
        "--out", type=named, metavar="FILE", help="file of the sweep (default: results/SCENE_TASK.sqlite)"
    )
    parser.add_argument("--jobs", type=int, metavar="N", help="cases at a time (default: by cores and ranks)")
    parser.add_argument("--ranks", type=int, default=1, metavar="N", help="ranks of each case (default: 1)")
    parser.add_argument(
        "--memory", type=float, metavar="MIB", help="of all cases at a time (default: what is free)"
    )
    parser.add_argument(
        "--wall", metavar="TIME", help="end in time, such as 8h or 1h30m; call again to go on"
    )
    parser.add_argument("--retry", action="store_true", help="compute cases again that have failed")
    parser.add_argument(
        "--dry-run", action="store_true", help="say how many cases there are, and what they take"
    )


def _share(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text} is not a number; give 0.01, or put --refine last") from None


def options_of_table(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command."""
    parser.add_argument("file", type=Path, help="file of a sweep")
    ways = parser.add_mutually_exclusive_group()
    ways.add_argument("--csv", action="store_true", help="all columns, as CSV")
    ways.add_argument("--parquet", type=named, metavar="FILE", help="write all columns there")


def options_of_show(parser: argparse.ArgumentParser) -> None:
    """Add the options that are for the file of a sweep."""
    parser.add_argument("--quantity", metavar="COLUMN", help="of a sweep: what to draw (see incipient table)")
    parser.add_argument(
        "--against", metavar="COLUMN", help="of a sweep: against what (default: what it varies first)"
    )
    parser.add_argument("--by", metavar="COLUMN", help="of a sweep: a curve for each value of this")


def refuse_options_of_show(options: argparse.Namespace) -> None:
    """Refuse what is for sweeps where none is shown."""
    for name in _OF_SHOW:
        if getattr(options, name) is not None:
            raise SceneError(f"--{name} is for the file of a sweep; {options.directory} is none")


def sweep(options: argparse.Namespace, comm: MPI.Comm) -> int:
    """Compute the cases that the file does not hold, and say what came out."""
    from ..parallel import collectively
    from ..progress import telling
    from ..sweep.call import Means, Prepared, computed
    from ..sweep.dry_run import foretold
    from ..sweep.live import watching
    from ..sweep.request import parsed_seconds, usual_file

    wall = float("inf") if options.wall is None else parsed_seconds(options.wall)
    means = Means(options.jobs, options.ranks, options.memory, wall, options.retry)
    places, files = means.places(comm), [Path()]
    prepared, lines = Prepared(), ""
    with collectively(comm):
        if comm.rank == 0:
            request = _request(options)
            files = [options.out or usual_file(request)]
            with telling(comm.rank) as voice:
                if options.dry_run:
                    lines = foretold(request, files[0], means, places, voice) + "\n"
                else:
                    prepared = Prepared.of(request, voice)
    if options.dry_run:
        print(lines, end="", flush=True)
        return 0
    with watching(comm) as watcher:
        progress = computed(prepared, files[0], means, watcher, comm)
    if comm.rank == 0:
        _tell(progress, files[0])
    return ConvergenceError.exit_code if progress.failed else 0


def _request(options: argparse.Namespace) -> Request:
    from ..sweep.axes import parsed
    from ..sweep.cases import Source
    from ..sweep.request import RefinementOptions, requested

    return requested(
        [Source.of(path) for path in options.scenes],
        [parsed(text) for text in options.over],
        options.zip,
        options.cases,
        options.do,
        options.overrides,
        RefinementOptions(options.refine, options.most, options.quantity),
    )


def _tell(progress: SweepProgress, file: Path) -> None:
    failed = f", {progress.failed} failed (again with --retry)" if progress.failed else ""
    print(
        f"cases               {progress.total}: {progress.done} computed{failed}, {progress.known} known before"
    )
    print("".join(f"{line}\n" for line in progress.refined), end="")
    print(f"numbers             {file}; incipient table {file}")
    print(f"pictures            incipient show {file}", flush=True)


def table(options: argparse.Namespace, comm: MPI.Comm) -> int:
    """Print or write the cases of a sweep, a row each."""
    from ..parallel import collectively
    from ..sweep import table as tables

    with collectively(comm):
        if comm.rank == 0 and options.parquet is not None:
            tables.write_parquet(options.file, options.parquet)
            print(options.parquet)
        elif comm.rank == 0 and options.csv:
            print(tables.as_csv(tables.rows(options.file)), end="", flush=True)
        elif comm.rank == 0:
            _print(options.file)
    return 0


def _print(file: Path) -> None:
    """The columns that differ between cases or tell what came out, for a reader."""
    from rich.console import Console
    from rich.table import Table

    from ..sweep.store import Store
    from ..sweep.table import columns, in_words, rows

    found = rows(file)
    with Store(file) as store:
        keys = store.keys()
    heads = [name for name in columns(found) if name in keys or name == "source"]
    if len({row["source"] for row in found}) == 1:
        heads.remove("source")
    shown = Table(box=None)
    for head in heads:
        unit = _unit(head, {row["task"] for row in found})
        numbers = all(_is_number(row[head]) for row in found if row.get(head) is not None)
        shown.add_column(f"{head}{unit}", overflow="fold", justify="right" if numbers else "left")
    shown.add_column("status", overflow="fold")
    shown.add_column("", overflow="fold")
    shown.add_column("time [s]", overflow="fold", justify="right")
    for row in found:
        said = in_words(row) if row["status"] in ("done", "failed", "damaged") else ""
        time = "" if row["wall"] is None else f"{row['wall']:.1f}"
        shown.add_row(*(_cell(row.get(head)) for head in heads), row["status"], said, time)
    Console(width=None if sys.stdout.isatty() else WIDE, markup=False).print(shown)


def _unit(key: str, tasks: Set[str]) -> str:
    """The unit of a key in brackets, after a space; nothing where it has none."""
    from ..scene import Scene
    from ..scene.key_units import unit_of
    from ..simulation.judge_case import Case

    unit = unit_of(Case if tasks == {"judge"} else Scene, key)
    return f" [{unit}]" if unit else ""


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _cell(value: object) -> str:
    return "" if value is None else f"{value:.6g}" if isinstance(value, float) else str(value)


def show(options: argparse.Namespace, comm: MPI.Comm) -> int:
    """Draw the pictures of a sweep beside its file."""
    from ..parallel import collectively
    from ..pictures.apart import draw_sweep_apart

    if options.animate or options.turntable or options.out is not None or options.field is not None:
        raise SceneError(
            f"{options.directory}: is the file of a sweep, which is not animated; leave the option out"
        )
    with collectively(comm):
        if comm.rank == 0:
            drawn = draw_sweep_apart(options.directory, **{name: getattr(options, name) for name in _OF_SHOW})
            for path in drawn.paths:
                print(path)
            if drawn.complaint:
                raise OutputError(drawn.complaint)
    return 0
