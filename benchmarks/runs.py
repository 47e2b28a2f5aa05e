"""Runs of scenes in this process, with the rows of their history."""

from __future__ import annotations

import tempfile
from pathlib import Path

from tables import Row, read_rows

import incipient
from incipient.results.result import Result
from incipient.scene import Scene


def run_with_history(scene: Scene) -> tuple[Result, list[Row]]:
    """A result, and what history.csv has of each step."""
    with tempfile.TemporaryDirectory() as directory:
        result = incipient.run(scene, directory)
        return result, read_rows(Path(directory) / "history.csv")
