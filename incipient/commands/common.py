"""What several commands share: options, and what is said of pictures."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import OutputError, SceneError

if TYPE_CHECKING:
    from mpi4py import MPI

    from ..pictures.apart import Drawn


def overrides(parser: argparse.ArgumentParser, example: str) -> None:
    """Add `--set`, with an example in its help."""
    repeated: dict[str, Any] = {"dest": "overrides", "action": "append", "default": []}
    parser.add_argument("--set", metavar="KEY=VALUE", help=f"such as {example}", **repeated)


def named(text: str) -> Path:
    """A path that is not empty: an empty one would mean the working directory."""
    if not text.strip():
        raise argparse.ArgumentTypeError("the name is empty; give the name of a directory or file")
    return Path(text)


def alone(name: str, comm: MPI.Comm) -> None:
    """Refuse ranks for a command that starts processes of its own."""
    if comm.size > 1:
        raise SceneError(f"{name} starts runs of its own; call it without mpirun")


def tell_of_pictures(directory: Path, wanted: bool, comm: MPI.Comm) -> None:
    """Draw pictures if they are wanted, and say where they are; one that fails takes nothing else with it."""
    from ..parallel import collectively

    with collectively(comm):
        if comm.rank == 0 and not wanted:
            print(f"pictures            incipient show {directory}", flush=True)
        elif comm.rank == 0:
            from ..pictures.apart import draw_apart

            say_drawn(draw_apart(directory), directory)


def say_drawn(drawn: Drawn, directory: Path) -> None:
    """Say where pictures are; raise what went wrong with others as an OutputError."""
    names = ", ".join(path.name for path in drawn.paths)
    print(f"pictures            {directory}/: {names}" if names else "pictures            none", flush=True)
    if drawn.complaint:
        raise OutputError(
            f"{drawn.complaint}; the rest is there, draw again with: incipient show {directory}"
        )
