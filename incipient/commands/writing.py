"""`incipient new` and `incipient schema`: what scenes are written from."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from .. import scene as scenes
from ..errors import SceneError
from ..files import reported
from ..parallel import Comm, collectively


def new(options: argparse.Namespace, comm: Comm) -> int:
    """Writes an example scene."""
    path = Path(options.name.removesuffix(".toml") + ".toml")
    if path.name == ".toml" or not options.name.strip():
        raise SceneError(
            f'"{options.name}" is no name of a scene; give one, as in incipient new grain'
        )
    with collectively(comm):
        if comm.rank == 0:
            with reported(path):
                try:
                    path.open("x", encoding="utf-8").write(scenes.example(options.space))
                except FileExistsError:
                    raise SceneError(f"{path}: exists already; choose another name") from None
            print(f"{path}: edit it, then: incipient run {path}")
    return 0


def schema(options: argparse.Namespace, comm: Comm) -> int:
    """Prints the JSON schema of scenes."""
    if comm.rank == 0:
        print(json.dumps(scenes.schema(), indent=2))
    return 0
