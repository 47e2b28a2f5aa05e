"""Forces per unit mass that sustain or change a base flow.

A gust multiplies the base flow, u = f(t) U(z); the force f' U represents pressure and stress of the surrounding flow:
without a grain the flow is f U exactly, whatever the size of the domain. It also acts on the volume of a grain, as the
undisturbed flow on displaced fluid (Maxey & Riley 1983, Phys. Fluids 26, 883).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import ufl

from ..arrays import Floats, cross, spatial
from ..fluid.model import Driven
from ..geometry.placement import Placement
from ..geometry.plane.grains import Grain
from ..geometry.space.grains import Solid

if TYPE_CHECKING:
    from .base_flow import BaseFlow

ACROSS = {2: 48, 3: 16}  # points across a grain, by the dimension


@dataclass(frozen=True, eq=False)
class DisplacedFluid:
    """The fluid displaced by a grain in a base flow."""

    grain: Grain | Solid
    base_flow: BaseFlow

    @cached_property
    def _points(self) -> Floats:
        grain, gdim = self.grain, self.base_flow.scene.gdim
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
        return placement.to_scene(self._points)

    def load(self, placement: Placement) -> Floats:
        """Force and torque about the centroid (2, 3) for unit rate of the factor of the flow."""
        points = self.points(placement)
        z = points[:, self.base_flow.scene.up] - self.base_flow.datum
        along = self.base_flow.at_factor_one(z, points[:, 1]) * self.grain.volume / len(points)
        forces = spatial(np.column_stack([along, np.zeros((len(along), points.shape[1] - 1))]))
        arms = spatial(points - np.array(placement.centre))
        return np.array([forces.sum(axis=0), cross(arms, forces).sum(axis=0)])


def driven(base_flow: BaseFlow, grain: Grain | Solid | None) -> Driven | None:
    """The base flow with its gust, which also acts on the fluid that a grain displaces; None without a gust."""
    if base_flow.gust is None:
        return None
    up = base_flow.scene.up

    def velocity(place: Any) -> Any:
        above, depth = place[up] - base_flow.datum, base_flow.depth
        speed = base_flow.driving_speed(ufl.max_value(0.0, ufl.min_value(above, depth)))
        flows = ufl.gt(above, -base_flow.round_off)
        return ufl.as_vector([ufl.conditional(flows, speed, 0.0), *[0] * up])

    displaced = None if grain is None else DisplacedFluid(grain, base_flow).load
    return Driven(velocity, base_flow.gust.factor, displaced)
