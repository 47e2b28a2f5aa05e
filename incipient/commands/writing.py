"""`incipient new` and `incipient schema`."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from .. import scene as scenes
from ..errors import SceneError
from ..files import reported, write_fully
from ..parallel import Comm, collectively


def new(options: argparse.Namespace, comm: Comm) -> int:
    """Write an example scene."""
    path = Path(options.name.removesuffix(".toml") + ".toml")
    if path.name == ".toml" or not options.name.strip():
        raise SceneError(
            f'"{options.name}" is not the name of a scene; give one, as in incipient new grain'
        )
    with collectively(comm):
        if comm.rank == 0:
            with reported(path):
                try:
                    file = path.open("xb", buffering=0)
                except FileExistsError:
                    raise SceneError(f"{path}: already exists; choose another name") from None
                with file:
                    write_fully(file, scenes.example(options.space).encode())
            print(f"{path}: edit it, then: incipient run {path}")
    return 0


def schema(options: argparse.Namespace, comm: Comm) -> int:
    """Print the JSON schema of scenes."""
    if comm.rank == 0:
        print(json.dumps(scenes.schema(), indent=2))
    return 0
