"""`incipient show`, `report`, `new` and `schema`."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import incipient

from .. import scene as scenes
from ..errors import OutputError, SceneError
from ..files import write_new
from ..pictures import animate_apart, draw_apart
from ..results.kinds import KINDS
from .options import OF_SWEEPS, require_left_by

RECORDS = (*(kind.record for kind in KINDS), "scene.toml")


def show(options: argparse.Namespace) -> None:
    """Draw or animate results."""
    if options.directory.suffix == ".toml":
        raise SceneError(
            f"{options.directory}: is a scene, not results; "
            "run it, then give the directory of the results"
        )
    sweep = options.directory.is_file()
    if not sweep:
        require_left_by(options.directory, RECORDS)
    elif options.animate:
        raise SceneError(
            f"{options.directory}: is the file of a sweep, which is not animated; "
            "leave the option out"
        )
    columns = {name: getattr(options, name) for name in OF_SWEEPS}
    for name, value in columns.items():
        if value is not None and not sweep:
            raise SceneError(
                f"--{name} applies to the file of a sweep; leave it out for {options.directory}"
            )
    if options.animate:
        print(animate_apart(options.directory, options.out, options.field or "velocity"))
        return
    drawn = draw_apart(options.directory, **(columns if sweep else {}))
    for path in drawn.paths:
        print(path)
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
    print(f"{path}: edit it, then: incipient run {path}")


def schema(options: argparse.Namespace) -> None:
    """Print the JSON schema of scenes."""
    print(json.dumps(scenes.schema(), indent=2))
