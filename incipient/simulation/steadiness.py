"""Whether a flow in time has become steady: what changes of it from step to step."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..results.result import Steadied

if TYPE_CHECKING:
    from ..effects.free_surface.part import MovingSurface
    from ..fluid import Fluid
    from ..fluid.transient import TimeStep


class Steadiness:
    """Watches how fast a flow changes, from the state at hand on. Every method is collective.

    The mesh of the fluid stays, or moves with the surface alone. `change` is from the state before to the present one,
    per unit of time: the larger of that of the velocities over the velocities, and that of the elevations over the
    `depth`, each in the root mean square over the nodes. The flow counts as steady where it is at most `asked`.
    """

    def __init__(self, fluid: Fluid, surface: MovingSurface | None, depth: float, asked: float):
        self._fluid, self._surface, self._depth, self._asked = fluid, surface, depth, asked
        self.change = np.inf
        self._before = fluid.state.x.array.copy()

    @property
    def reached(self) -> bool:
        """Whether the flow counts as steady."""
        return self.change <= self._asked

    def column(self, step: TimeStep) -> dict[str, float]:
        """Take note of a step; its column of the history."""
        now = self._fluid.state.x.array
        changed, whole = (self._fluid.squared_velocities(one) for one in (now - self._before, now))
        self._before = now.copy()
        relative = np.sqrt(changed / whole) if whole else 0.0
        if self._surface is not None:
            relative = max(relative, self._surface.change(self._depth))
        self.change = float(relative / step.length)
        return {"change": self.change}

    def result(self) -> Steadied:
        """The part of the result at the end. Not collective."""
        return Steadied(self.reached, self._fluid.time, self.change, self._asked)
