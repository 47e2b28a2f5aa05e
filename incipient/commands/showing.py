"""`incipient show`, `report`, `new` and `schema`."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from shlex import quote

import incipient

from .. import scene as scenes
from ..errors import OutputError, SceneError, refuse_broken
from ..files import write_new
from ..pictures import animate_apart, draw_apart
from ..results.kinds import KINDS
from .options import OF_SWEEPS, require_left_by

RECORDS = (*(kind.record for kind in KINDS), "scene.toml")


def show(options: argparse.Namespace) -> None:
    """Draw or animate results."""
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
    why = "applies to the file of a sweep; leave it out for"
    refuse_broken(*((not path.is_file(), f"--{name} {why} {path}") for name in columns))
    if options.animate:
        print(animate_apart(path, options.out, options.field or "velocity"))
        return
    drawn = draw_apart(path, **columns)
    for picture in drawn.paths:
        print(picture)
    if drawn.complaint:
        raise OutputError(drawn.complaint)


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
