"""Options that several commands have, and what they refuse alike."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import SceneError

if TYPE_CHECKING:
    from mpi4py import MPI


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
