"""What commands draw when they are done, and what they say of it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import OutputError

if TYPE_CHECKING:
    from mpi4py import MPI

    from ..pictures.apart import Drawn


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
