"""Walls of a mean flow: their distances from the mesh, and the inflow between them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ..errors import SceneError, refuse_broken
from ..scene import Scene, Turbulence
from .developed import of_discharge
from .inflow import Developed, Inflow, Measured
from .wall_law import CROSSING, WallLaw, shift

if TYPE_CHECKING:
    from ..setup.geometry import SideNames

# Distance of the mesh from smooth walls by model [nu/u*]: within the logarithmic layer, and in the viscous sublayer.
DISTANCE = {"k-epsilon": 50.0, "k-omega-sst": 0.45}
SMALL = 0.25  # of the distance of smooth walls, by which roughness moves a wall without an effect above 0.5%
LARGEST = 0.2  # roughness, and distance of the mesh from walls, over the depth
# Likewise over a grain's size, a layer on both its sides then being as thick as itself, and over half a bedform.
LARGEST_AT_GRAIN, LARGEST_AT_FORMS = 0.5, 2.0
LEAST_K = 1e-3  # k over u*^2, at which no more of it is destroyed: in still corners ln k would fall for ever
# Likewise over V^2 where a boundary layer enters: its edge otherwise is a front of ln k.
LEAST_K_MEASURED = 1e-4


@dataclass(frozen=True)
class Walls:
    """The walls of a flow, as estimated before its computation.

    depth:    of influence of a wall: of an open channel, or half the distance between two walls
    number:   of walls above each other at the inflow, one or two
    datum:    height at which the inflow starts: of the mesh past grains and bedforms, otherwise of the wall
    plane:    whether all walls are planes beyond the mesh: no bedforms, no grain
    names:    of the boundaries with a wall beyond them
    up:       axis of heights
    smooth:   distance of smooth walls from the mesh; past grains and bedforms in the law alone
    roughness: k_s of all walls but a grain; 0: smooth
    shear_velocity: u* of the inflow, of two walls the larger; bed_shear_velocity: at the lower wall
    asked:    the section [turbulence]
    """

    depth: float
    number: int
    datum: float
    top: float
    mean: float
    viscosity: float
    plane: bool
    names: tuple[str, ...]
    up: int
    smooth: float
    roughness: float
    shear_velocity: float
    bed_shear_velocity: float
    asked: Turbulence
    profile: Developed | Measured

    @property
    def unit(self) -> float:
        return self.viscosity / self.shear_velocity

    def distance(self, name: str) -> float:
        smooth = self.is_resolved or name == "body"
        return self.smooth if smooth else max(self.smooth, self.roughness)

    def is_rough(self, name: str) -> bool:
        """Whether a wall in the sublayer is modelled as a smooth one farther away; not by less than SMALL."""
        return self.is_resolved and name != "body" and self._beyond > SMALL * self.smooth

    @property
    def _beyond(self) -> float:
        return self.unit * shift(self.roughness / self.unit) if self.roughness else 0.0

    def from_origin(self, name: str) -> float:
        """Wall distance from the mesh in the turbulence model: beyond a rough wall in the sublayer."""
        if not self.is_rough(name):
            return self.distance(name)
        # Where the mesh reaches the wall the velocity vanishes there, and the roughness alone is beyond it.
        return self._beyond + (self.distance(name) if self.is_beyond(name) else 0.0)

    @property
    def nearest(self) -> float:
        return self.distance(self.names[0])

    def slip(self, name: str) -> float:
        """Slip length of the velocity next to a wall, by the law of friction.

        Without a distance between mesh and wall it vanishes with the thickness of the layer that the law represents.
        """
        y = self.distance(name)
        return y if self.is_beyond(name) else y * min(1.0, y / (CROSSING * self.unit)) ** 2

    @property
    def surfaces(self) -> tuple[str, ...]:
        """Names of the smooth walls in the viscous sublayer that the mesh reaches."""
        smooth = [name for name in self.names if not self.is_rough(name)]
        return tuple(name for name in smooth if self.is_resolved and not self.is_beyond(name))

    def is_beyond(self, name: str) -> bool:
        """Whether the mesh ends a distance from a wall: between planes, and below an upper wall."""
        return self.plane or name in self.names[1 : self.number]

    def law(self, name: str) -> WallLaw:
        return WallLaw(0.0 if name == "body" or self.is_resolved else self.roughness)

    @property
    def is_resolved(self) -> bool:
        return self.smooth < CROSSING * self.unit

    @property
    def ceiling(self) -> float:
        return self.top - (self.number - 1) * self.nearest

    @cached_property
    def inflow(self) -> Inflow:
        return Inflow(self, self.profile)

    @property
    def is_laminar(self) -> bool:
        return isinstance(self.profile, Developed) and self.profile.channel.is_laminar

    @property
    def least_k(self) -> float:
        least = LEAST_K * self.shear_velocity**2
        return max(least, LEAST_K_MEASURED * self.mean**2) if self.asked.profile else least

    def text(self) -> str:
        kind = "" if not self.roughness else f", u* k_s/nu about {self.roughness / self.unit:.3g}"
        return (
            f"walls {self.nearest:.3g} from the mesh, y+ about {self.nearest / self.unit:.3g}{kind}, "
            f"u* about {self.shear_velocity:.3g}"
        )


def walls_of(scene: Scene, names: SideNames, datum: float) -> Walls:
    """The walls of a flow, and their distances from the mesh. Not collective.

    datum: height at which the inflow starts

    Raises:
        SceneError: rows of the inflow lie beyond a wall, or walls are too rough or too far for the model.
        ConvergenceError: no developed flow converged.
    """
    asked, number = scene.turbulence or Turbulence(), 2 if scene.top == "wall" else 1
    depth, viscosity = (scene.domain.ceiling - datum) / number, scene.viscosity
    heights = [row[0] for row in asked.profile]
    lowest, highest = min(heights, default=0.0), max(heights, default=0.0)
    refuse_broken(
        (
            number == 1 and lowest > depth,
            f"turbulence.profile: has no row within the depth of {depth:.4g}; give heights in lengths of the scene",
        ),
        (
            number == 2 and highest >= number * depth,
            f"turbulence.profile: has a row at {highest:g}, the wall on top is {number * depth:.4g} above that below; "
            "leave out rows beyond it",
        ),
    )
    of_grain = math.inf if scene.grain is None else scene.grain.size
    of_roughness = {"roughness": min(depth, of_grain), "upstream_roughness": depth}
    for key, size in of_roughness.items():
        if (share := getattr(asked, key) / size) > LARGEST:
            raise SceneError(
                f"turbulence.{key}: is {getattr(asked, key):g}, {100 * share:.0f}% of the depth or the grain, at most "
                f"{100 * LARGEST:.0f}%; use a smaller one, or bedforms next to the grain and upstream_roughness"
            )
    mean = scene.reference_velocity
    roughness = asked.upstream_roughness or asked.roughness
    channel = of_discharge(mean * depth / viscosity, roughness / depth)
    shear_velocities = np.array([mean / channel.mean])
    profile: Developed | Measured = Developed(channel, depth, number, mean / channel.mean)
    if asked.inflow != "developed":
        profile = measured = Measured.of(asked, number, depth, mean, viscosity)
        if asked.profile:
            shear_velocities = measured.shear_velocities
    shear_velocity = float(shear_velocities.max())
    feature = scene.bed_shape.feature
    most = min(LARGEST * depth, LARGEST_AT_GRAIN * of_grain, LARGEST_AT_FORMS * feature)
    smooth = asked.wall_distance or min(DISTANCE[asked.model] * viscosity / shear_velocity, most)
    if smooth > most:
        raise SceneError(
            f"turbulence.wall_distance: is {smooth:g}, at most {most:.3g} in this depth and next to this grain and "
            "bedforms; leave it out, or use a smaller one"
        )
    plane = scene.grain is None and not np.isfinite(feature)
    return Walls(
        depth=depth,
        number=number,
        datum=datum,
        top=scene.domain.ceiling,
        mean=mean,
        viscosity=viscosity,
        plane=plane,
        names=(
            names.bottom,
            *((names.top,) if number == 2 else ()),
            *(() if scene.grain is None else ("body",)),
        ),
        up=scene.up,
        smooth=smooth,
        roughness=asked.roughness,
        shear_velocity=shear_velocity,
        bed_shear_velocity=float(shear_velocities[0]),
        asked=asked,
        profile=profile,
    )
