"""Turbulence of the flow, by a model of its means."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from ...errors import SceneError
from ...planning.effects import Decision, EffectName
from ...planning.numbers import Numbers
from ...planning.transition import REMEDY, transition, turbulent_from
from ...results.left_out import Omission
from ...scene import Scene
from ..effect import Effect, Solved

if TYPE_CHECKING:
    from ...mesh.domain import Domain
    from ..run_part import Stage
    from .part import TurbulentFlow


class TurbulenceEffect(Effect):
    """The k-epsilon model."""

    name = EffectName.TURBULENCE

    def decide(self, scene: Scene, numbers: Numbers) -> Decision:
        """Present where the scene asks for it; else the plan says where the flow may be turbulent."""
        if scene.is_turbulent:
            from ...planning.turbulence import walls_of

            told = f"k-epsilon model; {walls_of(scene).text(scene.viscosity)}"
            return Decision(self.name, True, f"effects.turbulence = true: {told}", True)
        off = scene.effects.turbulence is False
        reason = "effects.turbulence = false" if off else "only where it is asked for"
        if scene.flow.kind == "log-law":
            from ...planning.mean_profile import mean_profile

            reason += f"; mean profile only, the bed is {mean_profile(scene).regime()}"
            if numbers.flow_reynolds < turbulent_from(scene):
                least = turbulent_from(scene)
                reason += f"; flow Re {numbers.flow_reynolds:.3g}, but channels are laminar to {least:g}"
        elif found := transition(scene, numbers):
            reason += f"; {found.text()}; {REMEDY}"
        return Decision(self.name, False, reason, off)

    def warnings(self, scene: Scene) -> Iterator[str]:
        """Walls, beds and grains for which the law of the wall is doubtful; those for which it does not hold raise."""
        if not scene.is_turbulent:
            return
        from ...planning import turbulence as walls
        from ...planning.clearance import narrow_gap, through_the_top

        refusals = {
            "turbulence.": (walls.beyond_walls, walls.within_sand),
            "bed: ": (walls.within_forms,),
            "turbulence: ": (walls.too_small, walls.too_near),
            "body.": (through_the_top,),
        }
        for key, reasons in refusals.items():
            for reason in reasons:
                if why := reason(scene):
                    raise SceneError(f"{key}{why}")
        doubts = (walls.small, narrow_gap, walls.cornered, walls.coarse_at_grain, walls.smooth_grain)
        yield from filter(None, (doubt(scene) for doubt in doubts))

    def as_fast(self, scene: Scene, speed: float) -> Scene:
        """The scene of a flow as fast, whose law of the wall has another distance."""
        if not scene.is_turbulent or speed == 1.0:
            return scene
        from ...planning.turbulence import faster

        return faster(scene, speed)

    def part_at_start(self, scene: Scene, domain: Domain, stage: Stage) -> TurbulentFlow | None:
        """k and epsilon."""
        if not scene.is_turbulent:
            return None
        from .part import TurbulentFlow

        return TurbulentFlow(scene, domain, stage)

    def memory(self, scene: Scene, unknowns: int) -> float:
        """MiB of k and epsilon in space."""
        from ...planning.meshing_in_space import memory_of_eddies

        return memory_of_eddies(scene, unknowns)

    def left_out(self, solved: Solved, decision: Decision) -> Iterator[Omission]:
        """That fluctuations of a mean profile are not there, or that a laminar flow may be turbulent."""
        numbers, scene = solved.run.plan.numbers, solved.run.scene
        if scene.flow.kind == "log-law":
            how = "gusts, and mixing in the wake; the stream is the mean of a turbulent one"
            remedy = "loads are those of the mean stream, gusts exceed them"
            yield Omission(self.name, None, how, True, remedy)
        elif numbers is not None and (found := transition(scene, numbers)):
            how = f"{found.number} {found.value:.4g} is above {found.least:g}"
            yield Omission(self.name, None, how, True, f"the flow computed is the laminar one; {REMEDY}")
