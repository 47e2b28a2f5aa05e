"""The flow itself, of which a fluid at rest has none."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

from ..planning.clearance import near_inflow
from ..planning.effects import Decision, EffectName
from ..planning.flow_setup import Setup
from ..planning.numbers import Numbers
from ..planning.plan import Plan
from ..results.of_runs import FLOW
from .effect import Effect

if TYPE_CHECKING:
    from ..fluid import FlowModel


class FlowEffect(Effect):
    """The motion of the fluid."""

    name = EffectName.FLOW
    quantities = FLOW

    def decide(self, setup: Setup, numbers: Numbers) -> Decision:
        """Present unless the fluid is at rest and stays so."""
        scene = setup.scene
        return Decision(self.name, scene.flow.kind != "still" or scene.has_surface, _reason(setup))

    def terms(self, model: FlowModel, setup: Setup, plan: Plan, unsteady: bool) -> FlowModel:
        """The force by which the fluctuations of a turbulent base flow keep its mean profile."""
        if setup.scene.flow.kind != "log-law":
            return model
        from ..planning.mean_force import sustaining_force

        base_flow = setup.base_flow
        force = sustaining_force(base_flow.mean_profile, base_flow.datum, base_flow.domain.up)
        return replace(model, body_force=force)

    def warnings(self, setup: Setup) -> Iterator[str]:
        """A grain close to the inflow."""
        yield from filter(None, (near_inflow(setup.geometry, setup.scene.flow.kind == "still"),))


def _reason(setup: Setup) -> str:
    scene = setup.scene
    if scene.flow.kind == "log-law":
        return "mean profile of a turbulent flow, kept by a force instead of its turbulent stress"
    if scene.flow.kind != "still":
        mean = "; without [gusts], which incipient entrainment adds" if scene.gusts else ""
        return f"{scene.flow.kind} flow{mean}"
    return "the fluid starts from rest" if scene.has_surface else "the fluid is at rest"
