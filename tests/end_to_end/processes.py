"""Scenes, options and processes of the tests of whole runs, and what pictures must be."""

from __future__ import annotations

import json
import re
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image
from scenes import SCENES

# What the tests of whole runs share: scenes, options, processes of their own, and what they leave.


GRAIN_ON_BED, CAVITY, CYLINDER = (
    SCENES / f"{name}.toml" for name in ("grain_on_bed", "cavity", "cylinder")
)
VORTEX_STREET = SCENES / "vortex_street.toml"

Finished = subprocess.CompletedProcess


@dataclass(frozen=True)
class Outcome:
    """What one command came to: exit codes by rank, and the lines that all ranks said together."""

    codes: Sequence[int]
    lines: Sequence[str]

    @property
    def complaint(self) -> str:
        """The one line that says what went wrong, said once."""
        assert not any("Traceback" in line for line in self.lines), self.lines
        (line,) = [line for line in self.lines if line.startswith("incipient: ")]
        return line.removeprefix("incipient: ")


def overrides(**values: object) -> list[str]:
    """Overrides of a scene from `section_key=value`; the first underscore stands for the dot."""
    return [f"{name.replace('_', '.', 1)}={json.dumps(value)}" for name, value in values.items()]


def settings(**values: object) -> list[str]:
    """The same as options of a command."""
    return [part for pair in overrides(**values) for part in ("--set", pair)]


def result_of(directory: Path) -> dict[str, Any]:
    """The numbers that a run has left."""
    return json.loads((directory / "result.json").read_text())


def has_control_characters(text: str) -> bool:
    """Whether a text moves a terminal's cursor or changes its colours."""
    return re.search(r"[\x00-\x08\x0b-\x1f\x7f]", text) is not None


# What every picture must be: large enough, neither blank nor full, in colour.


def assert_is_a_picture(path, margin=True):
    pixels = np.asarray(Image.open(path).convert("RGB"))
    height, width, _ = pixels.shape
    assert width > 1000 and height > 600
    if margin:
        assert (pixels[:5] == 255).all() and (pixels[:, :3] == 255).all(), "a white margin"
    assert 0.02 < np.mean((pixels != 255).any(axis=2)) < (0.98 if margin else 1.0)
    assert len(np.unique(pixels @ np.array([65536, 256, 1]))) > 50  # colours
    assert path.stat().st_size > 20_000


def texts_of(figure):
    """Everything written on a figure, its legends and axes included."""
    written = [
        *figure.texts,
        *(text for axes in figure.axes for text in axes.texts),
        *(t for key in figure.legends for t in key.texts),
        *(title for axes in figure.axes for title in (axes.title, axes._left_title)),
    ]
    return [text.get_text() for text in written]
