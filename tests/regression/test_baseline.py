"""Results of whole command lines stay as they are (`make regression PART=plane`): the project's widest safety net."""

from __future__ import annotations

import json

import pytest
from baseline import CASES, STORED, differences, run

REFERENCE = json.loads(STORED.read_text())


@pytest.mark.regression
@pytest.mark.parametrize(
    "name", [pytest.param(name, id=f"{CASES[name].part}-{name}") for name in CASES]
)
def test_results_are_those_of_the_baseline(name: str) -> None:
    assert differences(REFERENCE[name], run(name)) == []


def test_a_changed_force_or_verdict_is_reported() -> None:
    """The comparison itself: 2e-6 of the force, another mode, and nothing else."""
    stored = REFERENCE["grain_on_bed"]
    assert differences(stored, stored) == []
    force = [1.000002 * component for component in stored["values"]["force"]]
    changed = {
        "values": stored["values"] | {"force": force},
        "labels": stored["labels"] | {"mode": "sliding"},
        "mesh": stored["mesh"],
    }
    assert [line.partition(":")[0] for line in differences(stored, changed)] == ["mode", "force"]
