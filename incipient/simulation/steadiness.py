"""Test for steady flow."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..results.result import Steadied

if TYPE_CHECKING:
    from ..effects.moving_surface import MovingSurface
    from ..fluid import Fluid
    from ..fluid.transient import TimeStep


class Steadiness:
    """Rate of change of an unsteady flow. Every method is collective.

    `change` per unit time is the larger of the relative change of the velocities and that of the
    elevations over `depth`, root mean squares; at most `asked` in steady flow.
    """

    def __init__(self, fluid: Fluid, surface: MovingSurface | None, depth: float, asked: float):
        self._fluid, self._surface, self._depth, self._asked = fluid, surface, depth, asked
        self.change = np.inf
        self._before = fluid.state.x.array.copy()

    @property
    def reached(self) -> bool:
        return self.change <= self._asked

    def column(self, step: TimeStep) -> dict[str, float]:
        now = self._fluid.state.x.array
        changed, whole = (self._fluid.squared_velocities(one) for one in (now - self._before, now))
        self._before = now.copy()
        relative = np.sqrt(changed / whole) if whole else 0.0
        if self._surface is not None:
            relative = max(relative, self._surface.change(self._depth))
        self.change = float(relative / step.length)
        return {"change": self.change}

    def result(self) -> Steadied:
        return Steadied(self.reached, self._fluid.time, self.change, self._asked)
