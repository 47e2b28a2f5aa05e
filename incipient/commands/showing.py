"""`incipient show`, `report`, `new` and `schema`, and the pictures of other commands."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from shlex import quote

import incipient

from .. import scene as scenes
from ..errors import OutputError, SceneError, refuse_broken
from ..files import write_new
from ..output.ownership import CHECKPOINT, RESULT
from ..parallel import Comm, on_first
from ..results.kinds import KINDS
from .options import OF_SWEEPS, require_left_by

RECORDS = (*(kind.record for kind in KINDS), "scene.toml")


def show(options: argparse.Namespace) -> None:
    """Draw or animate results."""
    from ..pictures import animate_apart, draw_apart

    path = options.directory
    chosen = {name: getattr(options, name) for name in OF_SWEEPS}
    columns = {name: column for name, column in chosen.items() if column is not None}
    refuse_broken(
        (
            path.suffix == ".toml" and path.is_file(),
            f"{path}: is a scene, not results; run it, then give the directory of the results",
        ),
        (
            path.is_file() and options.animate,
            f"{path}: is the file of a sweep, which is not animated; leave the option out",
        ),
    )
    if not path.is_file():
        require_left_by(path, RECORDS)
    unfinished = (path / CHECKPOINT).is_file() and not (path / RESULT).is_file()
    again = f"incipient resume {quote(str(path))}"
    why = f"{path}: the run is not finished; continue it with: {again}"
    refuse_broken((unfinished and not options.animate, why))
    why = "applies to the file of a sweep; leave it out for"
    refuse_broken(*((not path.is_file(), f"--{name} {why} {path}") for name in columns))
    if options.animate:
        print(animate_apart(path, options.out, options.field or "velocity"))
        return
    drawn = draw_apart(path, **columns)
    for picture in drawn.paths:
        print(picture)
    if drawn.complaint:
        raise drawn.error(drawn.complaint)


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


def report(options: argparse.Namespace) -> None:
    """Write the page of results and print its path."""
    print(incipient.report(options.path, options.out), flush=True)


def new(options: argparse.Namespace) -> None:
    """Write an example scene."""
    path = Path(options.name.removesuffix(".toml") + ".toml")
    if path.name == ".toml" or not options.name.strip():
        raise SceneError(
            f'"{options.name}" is not the name of a scene; give one, as in incipient new grain'
        )
    write_new(path, scenes.example(options.space))
    print(f"{path}: edit it, then: incipient run {quote(str(path))}")


def schema(options: argparse.Namespace) -> None:
    """Print the JSON schema of scenes."""
    print(json.dumps(scenes.schema(), indent=2))
