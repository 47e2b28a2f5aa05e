"""An effect added as docs/contribute/adding.md says: a decision in the table, and what it adds to a run.

The effect is a force per unit mass f along x, as gravity has in an inclined channel that is not resolved otherwise.
With velocities given all around but at the outflow it only adds f (x - x_outflow) to the pressure: the velocity stays,
and the load on a grain of area A changes by -f A along x (Archimedes' law for f), exactly.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import pytest
import ufl

import incipient
from incipient.effects import known
from incipient.effects.effect import Effect, Solved
from incipient.fluid import FlowModel
from incipient.planning import doubts, effects
from incipient.planning.effects import Decision
from incipient.planning.plan import Plan
from incipient.results.left_out import Omission
from incipient.scene import Disc, Domain, Fluid, Numerics, Output, Poiseuille, Scene
from incipient.setup.setup import Setup

FORCE = 0.3
SCENE = Scene(
    domain=Domain(length=6, height=3),
    fluid=Fluid(reynolds=0.001, scale="grain"),
    flow=Poiseuille(),
    body=Disc(diameter=1, centre=(2, 1.2)),
    numerics=Numerics(mesh_size=3, error_bars=False),
    output=Output(fields=False),
)


NAME: Any = "driving force"


def decision(setup: Setup) -> Decision:
    """Present where the title says so."""
    there = "driven" in setup.scene.title
    return Decision(NAME, there, f"f = {FORCE:g}" if there else "the title does not ask for it")


def doubt(setup: Setup) -> Iterator[str]:
    """A warning that a reader can look for."""
    if "driven" in setup.scene.title:
        yield "the driving force is the same everywhere"


class DrivingForce(Effect):
    """A uniform force along x, where the scene's title asks for it."""

    name = NAME

    def terms(self, model: FlowModel, setup: Setup, plan: Plan, unsteady: bool) -> FlowModel:
        """The force in the equation of momentum."""
        return replace(model, body_force=lambda x, t: ufl.as_vector([FORCE, 0.0]))

    def left_out(self, solved: Solved, decision: Decision) -> Iterator[Omission]:
        """What it would change: known."""
        yield Omission(self.name, 0.5, "by Archimedes' law", False, "name the scene so")


@pytest.fixture
def added(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(effects, "TABLE", (*effects.TABLE, decision))
    monkeypatch.setattr(doubts, "DOUBTS", (*doubts.DOUBTS, doubt))
    monkeypatch.setattr(known, "EFFECTS", (*known.EFFECTS, DrivingForce()))


@pytest.mark.usefixtures("added")
def test_an_effect_in_the_list_is_planned_computed_and_reported() -> None:
    without = incipient.run(SCENE)
    driven = incipient.run(SCENE.model_copy(update={"title": "A disc in a driven channel"}))
    assert without.force is not None and driven.force is not None
    change = driven.force.flow - without.force.flow
    assert change[0] == pytest.approx(
        -FORCE * SCENE.grain.volume, rel=2e-3
    )  # of the polygon that cells make of it
    assert change[1] == pytest.approx(0.0, abs=1e-6 * FORCE)
    assert "yes  driving force: f = 0.3" in driven.plan.text()
    assert "warning: the driving force is the same everywhere" in driven.plan.text()
    assert [one.name for one in without.omitted if one.exceeds] == ["driving force"]
    assert not [one for one in driven.omitted if one.name == "driving force"]


def test_without_the_entry_there_is_none() -> None:
    assert "driving force" not in incipient.make_plan(SCENE).text()
