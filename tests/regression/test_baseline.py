"""Results of whole command lines stay as they are (`make regression PART=plane`): the project's widest safety net."""

from __future__ import annotations

import json
from typing import Any

import pytest
from baseline import CASES, PROCESSORS, STORED, differences, processor, run

REFERENCE = json.loads(STORED.read_text())


@pytest.mark.regression
@pytest.mark.parametrize(
    "name", [pytest.param(name, id=f"{CASES[name].part}-{name}") for name in CASES]
)
def test_results_are_those_of_the_baseline(name: str) -> None:
    assert differences(REFERENCE[name], run(name), processor()) == []


def changed(name: str, factor: float, **labels: str) -> dict[str, Any]:
    """A stored case with its force times a factor, and other labels."""
    stored = REFERENCE[name]
    force = [factor * component for component in stored["values"]["force"]]
    values, labels = stored["values"] | {"force": force}, stored["labels"] | labels
    return {"values": values, "labels": labels, "mesh": stored["mesh"]}


def differing(name: str, now: dict[str, Any], make: str) -> list[str]:
    return [line.partition(":")[0] for line in differences(REFERENCE[name], now, make)]


@pytest.mark.parametrize("make", PROCESSORS)
def test_a_changed_force_or_verdict_is_reported(make: str) -> None:
    """The comparison itself: 2e-6 of the force, another mode, and nothing else."""
    name = "grain_on_bed"
    assert differing(name, changed(name, 1.0), make) == []
    assert differing(name, changed(name, 1.000002, mode="sliding"), make) == ["mode", "force"]


def test_a_case_of_another_mesh_on_a_make_of_processor_is_compared_with_its_own() -> None:
    """To 1e-6 with its own on that make; on one that nothing is stored of, within the discretisation error."""
    name, make = "leaving_pocket", "AuthenticAMD"
    own = REFERENCE[name]["also"][make]
    assert differing(name, own, make) == []
    assert "force" in differing(name, own, "GenuineIntel")
    assert "force" in differing(name, changed(name, 1.0), make)
    assert differing(name, own, "another") == differing(name, changed(name, 1.0), "another") == []
    assert differing(name, changed(name, 1.1), "another") == ["force"]
    assert differing("judge_disc", REFERENCE["judge_disc"], "another") == []
