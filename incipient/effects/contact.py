"""Contact of a grain at rest on a bed: its contact forces and the verdict."""

from __future__ import annotations

from collections.abc import Iterator

from ..planning.effects import Decision, EffectName
from ..planning.flow_setup import Setup
from ..planning.numbers import Numbers
from ..results.left_out import Omission
from ..results.of_runs import VERDICT
from ..scene.grains import FRICTIONLESS
from ..scene.model import WIDE_GAP
from ..scene.settling import DEFAULT_FRICTION
from .effect import Effect, Solved

NEARER = 0.95  # of the gap that a released grain keeps: from where it may begin


class ContactEffect(Effect):
    """Contact forces between a grain at rest and its bed, by which both judges decide."""

    name = EffectName.CONTACT
    quantities = VERDICT

    def decide(self, setup: Setup, numbers: Numbers) -> Decision:
        """Present where a grain rests on a bed."""
        scene = setup.scene
        if not scene.rests:
            return Decision(self.name, False, "no grain rests on a bed")
        if scene.effects.contact is False:
            return Decision(self.name, False, "effects.contact = false: no verdict", True)
        reason = "the grain rests on the bed"
        if scene.body is not None and scene.body.settle == FRICTIONLESS:
            reason += ", where it settled without friction"
        elif scene.body is not None and scene.body.settle:
            friction = DEFAULT_FRICTION if scene.contact is None else scene.contact.friction
            reason += f", where it settled with friction {friction:g}"
            reason += ' (settle = "frictionless" gives one rest to compare)'
        return Decision(self.name, True, reason, scene.effects.contact is True)

    def warnings(self, setup: Setup) -> Iterator[str]:
        """A wide gap between grain and bed, and a released grain that begins nearer to the bed than that."""
        scene = setup.scene
        gap = scene.contact.gap if scene.contact is not None and not scene.closes_contacts else 0.0
        if gap > WIDE_GAP and scene.body is not None and (scene.rests or scene.body.moves):
            yield (
                f"contact.gap = {gap:g} is wide: contact is judged by the flow around a grain {gap:g} of its size "
                f"away from the bed; give {WIDE_GAP:g} or less"
            )
        if scene.body is None or scene.body.motion != "released":
            return
        begins, kept = setup.geometry.stance.gap, gap * setup.geometry.grain.size
        if begins < NEARER * kept:
            yield (
                f"the grain begins {begins:.3g} from its bed, nearer than its gap of {kept:.3g}, which the first step "
                "puts right: it stands on one side alone; set body.settle = true"
            )

    def left_out(self, solved: Solved, decision: Decision) -> Iterator[Omission]:
        """The verdict, which there is none of without contact."""
        if decision.forced:
            yield Omission(self.name, None, "there is no verdict without it", False)
