"""The third dimension of a 3-D flow."""

from __future__ import annotations

from ..planning.effects import Decision, EffectName
from ..planning.flow_setup import Setup
from ..planning.numbers import Numbers
from ..scene.symmetry import differences
from .effect import Effect

_DIMENSIONS = {2: "two-dimensional", 3: "three-dimensional"}


class ThirdDimensionEffect(Effect):
    """3-D flow instead of 2-D, in half of the domain where the flow is its own mirror image."""

    name = EffectName.THIRD_DIMENSION

    def decide(self, setup: Setup, numbers: Numbers) -> Decision:
        """Present with domain.width."""
        scene = setup.scene
        reason = f"the scene is {_DIMENSIONS[scene.gdim]}"
        if scene.gdim == 2:
            return Decision(self.name, False, reason)

        if setup.symmetric:
            reason += f"; half of it is computed: it is its own mirror image in y = {scene.domain.middle:g}"
        elif scene.domain.symmetric is False:
            reason += "; the whole of it is computed: domain.symmetric = false"
        else:
            reason += f"; the whole of it is computed: {next(differences(scene), '')}"
        return Decision(self.name, True, reason, scene.effects.third_dimension is True)
