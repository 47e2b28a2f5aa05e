"""`incipient report`: one HTML page of results."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from .options import named

if TYPE_CHECKING:
    from mpi4py import MPI


def options_of_report(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command."""
    parser.add_argument("path", type=Path, help="directory of the results, or the file of a sweep")
    parser.add_argument(
        "--out", type=named, metavar="FILE", help="the page (default: report.html there, or beside the sweep)"
    )


def report(options: argparse.Namespace, comm: MPI.Comm) -> int:
    """Write the page and say where it is."""
    import incipient

    from ..parallel import collectively

    with collectively(comm):
        if comm.rank == 0:
            print(incipient.report(options.path, options.out), flush=True)
    return 0
