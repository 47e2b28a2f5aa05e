"""`incipient judge`: forces and contacts from elsewhere."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..output.ownership import refuse_foreign
from .drawing import say_drawn
from .options import named, overrides

if TYPE_CHECKING:
    from mpi4py import MPI

    from ..simulation.judge_case import Case

BESIDE = object()  # a directory that is asked for and not named: that of the case


def options_of_judge(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command."""
    parser.add_argument("case", type=Path, help="case file (TOML)")
    overrides(parser, "contacts.friction=0.4")
    parser.add_argument(
        "--series",
        type=named,
        metavar="FILE",
        help="judge a series of loads: .csv or .parquet with time, force_x, force_y, couple (docs/contact.md)",
    )
    parser.add_argument(
        "--out",
        nargs="?",
        type=named,
        const=BESIDE,
        metavar="DIRECTORY",
        help="write judgement.json and its picture there; without a DIRECTORY next to the case",
    )


def judge(options: argparse.Namespace, comm: MPI.Comm) -> int:
    """Judge a case and say what came out; keep it if that is asked for."""
    from ..parallel import collectively
    from ..simulation.judge_case import judge_case, load_case, text

    with collectively(comm):
        if comm.rank == 0:
            case = load_case(options.case, options.overrides)
            if options.series is not None:
                _judge_series(case, options)
                return 0
            judgement = judge_case(case)
            print(text(case, judgement))
            if options.out is not None:
                _keep(judgement, options.case.parent if options.out is BESIDE else options.out)
    return 0


def _judge_series(case: Case, options: argparse.Namespace) -> None:
    from ..simulation.judge_series import judge_series, read_columns, save_series

    found = judge_series(case, read_columns(options.series))
    print(found.text())
    if options.out is not None:
        directory = options.series.parent if options.out is BESIDE else options.out
        refuse_foreign(directory, ("series.csv", "series.json"))
        save_series(found, directory)
        print(f"numbers             {directory}/: series.csv, series.json", flush=True)
        from ..pictures.apart import draw_apart

        say_drawn(draw_apart(directory), directory)


def _keep(judgement: dict[str, Any], directory: Path) -> None:
    """Write a judgement and its picture, and say where they are."""
    from ..pictures.apart import draw_apart
    from ..simulation.judge_case import save

    refuse_foreign(directory, ("judgement.json",))
    save(judgement, directory)
    print(f"numbers             {directory / 'judgement.json'}", flush=True)
    say_drawn(draw_apart(directory), directory)
