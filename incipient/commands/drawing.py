"""Drawing of pictures at the end of commands."""

from __future__ import annotations

from pathlib import Path
from shlex import quote

from ..errors import OutputError
from ..parallel import Comm, on_first


def tell_of_pictures(directory: Path, wanted: bool, comm: Comm) -> None:
    """Draw requested pictures and print their paths, or how to draw them. Collective; raises as `draw_and_tell`."""
    if wanted:
        on_first(comm, draw_and_tell, directory)
    elif comm.rank == 0:
        print(f"pictures            incipient show {quote(str(directory))}", flush=True)


def draw_and_tell(directory: Path) -> None:
    """Draw the pictures of a directory and print their paths. Raises OutputError for failed ones."""
    from ..pictures import draw_apart

    drawn = draw_apart(directory)
    names = ", ".join(path.name for path in drawn.paths)
    print(
        f"pictures            {directory}/: {names}" if names else "pictures            none",
        flush=True,
    )
    if drawn.complaint:
        raise OutputError(
            f"{drawn.complaint}; "
            f"the other results are complete, draw again with: incipient show {quote(str(directory))}"
        )
