"""`incipient new` and `incipient schema`."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from .. import scene as scenes
from ..errors import SceneError
from ..files import opened_new, write_fully


def new(options: argparse.Namespace) -> None:
    """Write an example scene."""
    path = Path(options.name.removesuffix(".toml") + ".toml")
    if path.name == ".toml" or not options.name.strip():
        raise SceneError(
            f'"{options.name}" is not the name of a scene; give one, as in incipient new grain'
        )
    with opened_new(path) as file:
        write_fully(file, scenes.example(options.space).encode())
    print(f"{path}: edit it, then: incipient run {path}")


def schema(options: argparse.Namespace) -> None:
    """Print the JSON schema of scenes."""
    print(json.dumps(scenes.schema(), indent=2))
