"""Free surface; a rigid lid neglects a rise of Fr^2/2 of the depth (Bernoulli's equation)."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

from ...planning.effects import Decision, EffectName, percent
from ...planning.expense import memory_of_surface
from ...planning.flow_setup import Setup
from ...planning.numbers import Numbers
from ...planning.open_channel import froude, near_critical, wave_of
from ...results.left_out import Omission
from ...scene.rules import STREAMS
from ..effect import Effect, Solved
from ..run_part import Stage

if TYPE_CHECKING:
    from ...restart.checkpoint import Checkpoint
    from .part import MovingSurface


class FreeSurfaceEffect(Effect):
    """A top boundary that moves with the fluid."""

    name = EffectName.FREE_SURFACE

    def decide(self, setup: Setup, numbers: Numbers) -> Decision:
        """Present with domain.top = "free-surface"."""
        scene = setup.scene
        if scene.has_surface:
            from ...planning.surface import sticking

            speed = math.sqrt(float(abs(scene.gravity_vector).max()) * scene.domain.height)
            reason = f'domain.top = "{scene.top}"; long waves travel at {speed:.3g}'
            if pinned := sticking(setup):
                reason += f"; the fluid sticks to {' and '.join(pinned)}, where its elevation stays"
            return Decision(self.name, True, reason + _ends(setup))
        reason = f'domain.top = "{scene.top}"'
        if scene.top != "slip" or numbers.froude is None:
            return Decision(self.name, False, reason)
        rise = 0.5 * numbers.froude**2
        reason += f"; Froude number {numbers.froude:.2g}: a surface would rise by {percent(rise)} of the depth"
        return Decision(self.name, False, reason, expected=rise)

    def warnings(self, setup: Setup) -> Iterator[str]:
        """A nearly critical flow."""
        yield from filter(None, (near_critical(setup),))

    def part_in_time(
        self, setup: Setup, stage: Stage, kept: Checkpoint | None
    ) -> MovingSurface | None:
        """The surface."""
        if not setup.scene.has_surface:
            return None
        from .part import MovingSurface

        return MovingSurface(setup, stage)

    def memory(self, setup: Setup, unknowns: int) -> float:
        """Memory [MiB] of a 3-D surface."""
        scene = setup.scene
        if scene.gdim == 2 or not scene.has_surface:
            return 0.0
        return memory_of_surface(unknowns, scene.time is not None and scene.time.start != "rest")

    def left_out(self, solved: Solved, decision: Decision) -> Iterator[Omission]:
        """Rise of a surface by the pressure under a rigid lid, relative to the depth."""
        if decision.expected is None:
            return
        scene = solved.run.scene
        from .lid import rise_under_lid

        rise = rise_under_lid(solved.run) / Setup(scene).base_flow.depth
        may_be = scene.domain.kind == "box" or scene.flow.kind in STREAMS
        remedy = (
            'domain.top = "free-surface"'
            if may_be and not scene.is_averaged
            else "a deeper channel"
        )
        if rise > 1.0:
            how = f"the pressure under the lid is that of {rise:.2g} depths, as after an impulse"
            yield Omission(self.name, None, how, True, remedy)
            return
        how = "of the depth, by the pressure under the lid over gravity"
        yield Omission(self.name, rise, how, False, remedy)


def _ends(setup: Setup) -> str:
    """Describe the end conditions of a channel with a free surface; "" for a box."""
    if setup.geometry.domain.kind == "box":
        return ""
    surface, speed, wave = setup.surface, froude(setup), wave_of(setup)
    text = f"; Froude number {speed:.2g}" if speed else ""
    text += f"; the level is {'the still one' if speed >= 1.0 else 'free'} at the inflow, "
    text += (
        "that of the still fluid beyond the outflow"
        if surface.outflow == "open"
        else "and a wall at the right end"
    )
    if wave is not None:
        text += f"; a wave {2 * math.pi / wave.number:.3g} long comes in"
    return text + (f"; waves die out over the last {surface.sponge:g}" if surface.sponge else "")
