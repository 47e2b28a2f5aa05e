"""Free or prescribed motion of a grain in the flow."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from ...body.state import BodyState
from ...planning.effects import Decision, EffectName
from ...planning.flow_setup import Setup
from ...planning.numbers import Numbers
from ...results.left_out import Omission
from ...results.quantity import OutputQuantity
from ..effect import Effect, Solved
from ..run_part import Stage

if TYPE_CHECKING:
    from ...restart.checkpoint import Checkpoint
    from .part import MovingGrain


class FreeBodyEffect(Effect):
    """Free or prescribed motion of a rigid grain."""

    name = EffectName.FREE_BODY
    quantities = (
        OutputQuantity("trajectory.on_bed.first_motion", "first motion", "time", "first_motion"),
        OutputQuantity("trajectory.on_bed.left_pocket", "left its pocket", "time", "left_pocket"),
        OutputQuantity("trajectory.on_bed.mode", "what it does at the end", column="does"),
        OutputQuantity("trajectory.ended.by", "what ended its run", column="ended"),
    )

    def decide(self, setup: Setup, numbers: Numbers) -> Decision:
        """Present with body.motion = "free" or "released"."""
        body = setup.scene.body
        if body is None:
            return Decision(self.name, False, "no [body] section")
        reason = f'body.motion = "{body.motion}"'
        if body.locked:
            reason += f" but for {', '.join(body.locked)}"
        if body.is_free and numbers.density_ratio is not None and numbers.stokes is not None:
            reason += (
                f"; density ratio {numbers.density_ratio:.3g}, Stokes number {numbers.stokes:.2g}"
            )
        return Decision(self.name, body.is_free, reason, setup.scene.effects.free_body != "auto")

    def part_in_time(
        self, setup: Setup, stage: Stage, kept: Checkpoint | None
    ) -> MovingGrain | None:
        """The moving grain."""
        if not setup.scene.moves:
            return None
        state = (
            None if kept is None or kept.body is None else BodyState.unpacked(kept.body.made_for)
        )
        assert setup.scene.body is not None
        if setup.scene.body.touches:
            from .on_bed import GrainOnBed

            return GrainOnBed(setup, stage, state)
        from .part import MovingGrain

        return MovingGrain(setup, stage, state)

    def left_out(self, solved: Solved, decision: Decision) -> Iterator[Omission]:
        """A fixed grain that would have begun to move."""
        verdict = solved.verdict or {}
        since, rocking = verdict.get("first_motion"), verdict.get("rocking")
        if since is None:
            return
        does = "moves" if rocking is None or rocking["leaves"] else "rocks"
        pose = "" if rocking is None else "; this time and the history are judged in the first pose"
        yield Omission(
            self.name, None, f"the grain {does} from t = {since:.4g} on, but was held{pose}", False
        )
