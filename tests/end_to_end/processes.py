"""What the tests of whole runs share: scenes, options, processes of their own, and what they leave."""

from __future__ import annotations

import json
import re
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

SCENES = Path(__file__).parents[2] / "demos" / "scenes"
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


def settings(**values: object) -> list[str]:
    """Options from `section_key=value`; the first underscore stands for the dot."""
    pairs = [f"{name.replace('_', '.', 1)}={json.dumps(value)}" for name, value in values.items()]
    return [part for pair in pairs for part in ("--set", pair)]


def result_of(directory: Path) -> dict[str, Any]:
    """The numbers that a run has left."""
    return json.loads((directory / "result.json").read_text())


def has_control_characters(text: str) -> bool:
    """Whether a text moves a terminal's cursor or changes its colours."""
    return re.search(r"[\x00-\x08\x0b-\x1f\x7f]", text) is not None
