"""Force of a gust that multiplies a base flow: on the fluid, and on the fluid that the grain displaces.

The base flow u = f(t) U(z) has the rate of change f' U, due to pressure and stress of the surrounding flow. The
force f' U per unit mass represents them: without a grain the flow is f U exactly, whatever the size of the domain. It
also acts on the volume of a grain: the force of the undisturbed flow on the fluid displaced (Maxey & Riley 1983, Phys.
Fluids 26, 883).
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import ufl

from ..arrays import Floats, cross, spatial
from ..fluid.model import Driven
from ..geometry.placement import Placement
from ..geometry.plane.grains import Grain
from ..geometry.space.grains import Solid
from .base_flow import ROUND_OFF, BaseFlow

ACROSS = {2: 48, 3: 16}  # points across a grain, by the dimension


@dataclass(frozen=True, eq=False)
class DisplacedFluid:
    """The fluid whose place a grain takes in a base flow."""

    grain: Grain | Solid
    base_flow: BaseFlow

    @cached_property
    def _points(self) -> Floats:
        """(n, gdim) in the frame of the grain, of equal volumes, about its centroid."""
        grain, gdim = self.grain, self.base_flow.domain.gdim
        skin = (
            grain.chain.points(ACROSS[gdim])
            if isinstance(grain, Grain)
            else grain.surface(0.1 * grain.size).points
        )
        share, low, high = (
            (np.arange(ACROSS[gdim]) + 0.5) / ACROSS[gdim],
            skin.min(axis=0),
            skin.max(axis=0),
        )
        points = np.stack(
            np.meshgrid(*np.outer(high - low, share) + low[:, None]), axis=-1
        ).reshape(-1, gdim)
        inside = points[grain.level(points) < 0.0]
        return np.asarray(inside - inside.mean(axis=0))

    def points(self, placement: Placement) -> Floats:
        """(n, gdim) points that represent equal volumes of the grain at its placement."""
        return placement.to_scene(self._points)

    def load(self, placement: Placement) -> Floats:
        """Force and torque about the centroid (2, 3) for unit rate of the factor of the flow."""
        points = self.points(placement)
        speeds = self.base_flow.profile(points.T)
        forces = spatial(np.column_stack([speeds, np.zeros((len(speeds), points.shape[1] - 1))]))
        forces *= self.grain.volume / len(points)
        arms = spatial(points - np.array(placement.centre))
        return np.array([forces.sum(axis=0), cross(arms, forces).sum(axis=0)])


def driven(base_flow: BaseFlow, grain: Grain | Solid | None) -> Driven:
    """The base flow with its gust, for `FlowModel.driven`."""
    displaced = None if grain is None else DisplacedFluid(grain, base_flow).load
    return Driven(_velocity(base_flow), base_flow.factor, displaced)


def _velocity(base_flow: BaseFlow) -> Any:
    """Function of position (UFL) that gives the base flow without its gust (UFL)."""
    up = base_flow.domain.up

    def velocity(place: Any) -> Any:
        """The base flow without its gust at a position, both in UFL; zero below the datum."""
        above, depth = place[up] - base_flow.datum, base_flow.depth
        speed = base_flow.speed_at(ufl.max_value(0.0, ufl.min_value(above, depth)))
        flows = ufl.gt(above, -ROUND_OFF * depth)
        return ufl.as_vector([ufl.conditional(flows, speed, 0.0), *[0] * up])

    return velocity
