"""A scene with its derived parts before meshing and computation, each derived once."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from ..scene import Scene, Surface, Turbulence
from ..scene.symmetry import differences
from .base_flow import BaseFlow
from .cells import FarCells
from .clearance import Surroundings, surroundings_of
from .effects import Decision, inertia_of
from .meshed_bed import height_at_inflow
from .numbers import Numbers, numbers_of
from .order import VelocityOrder, velocity_order
from .scene_geometry import Geometry
from .sides import SideNames, side_names

if TYPE_CHECKING:
    from ..turbulence.walls import Walls

WITH_BED_STRESS = ("shear", "poiseuille", "open-channel", "log-law")  # kinds of base flows


@dataclass(frozen=True, eq=False)
class Setup:
    """A scene and its parts: each is made on first use, and modules of absent parts are never imported.

    No method is collective.
    """

    scene: Scene

    @cached_property
    def geometry(self) -> Geometry:
        """Grain and bed in the domain."""
        scene = self.scene
        return Geometry(
            domain=scene.domain,
            grain=scene.grain,
            bed=scene.bed_shape,
            placement=scene.placement,
            rests=scene.rests,
            moves=scene.moves,
            touches=scene.body is not None and scene.body.touches,
            gap=scene.contact_gap,
            tolerance=scene.contact_tolerance,
            top=scene.top,
            sides=scene.sides,
            symmetric=self.symmetric,
            meshed_bed=scene.numerics.meshed_bed,
        )

    @cached_property
    def symmetric(self) -> bool:
        """Whether only one half of a symmetric 3-D domain is computed."""
        asked = self.scene.domain.symmetric
        if self.scene.gdim == 2 or asked is False:
            return False
        return asked is True or next(differences(self.scene), None) is None

    @cached_property
    def order(self) -> VelocityOrder:
        """Order of the velocity: that of the scene, or for "auto" the measured optimum."""
        return velocity_order(self)

    @cached_property
    def numbers(self) -> Numbers:
        """The scene's dimensionless numbers."""
        return numbers_of(self)

    @cached_property
    def inertia(self) -> Decision:
        """Whether the flow has inertia, and why."""
        return inertia_of(self, self.numbers)

    @cached_property
    def sides(self) -> SideNames:
        """Names of the sides of the domain."""
        return side_names(self.scene.domain, self.scene.bed is not None, self.symmetric)

    @cached_property
    def base_flow(self) -> BaseFlow:
        """The flow without grain and bed forms."""
        return self.base_flow_at(1.0)

    def base_flow_at(self, speed: float) -> BaseFlow:
        """The base flow of a flow faster by a factor, in its own units: only the datum may be another one."""
        scene = self.scene
        return BaseFlow(
            flow=scene.flow,
            domain=scene.domain,
            bed=scene.bed_shape,
            reference=scene.reference_velocity,
            viscosity=scene.viscosity,
            walled=scene.gdim == 3 and scene.sides == "wall",
            creeping=not scene.fluid.inertia or scene.effects.inertia is False,
            speed=speed,
        )

    @cached_property
    def far_cells(self) -> FarCells:
        """The cells away from everything."""
        scene = self.scene
        reynolds = scene.fluid.reynolds if scene.is_empty_box else None
        return FarCells(scene.domain.extents, self.order.number, reynolds)

    @property
    def turbulence(self) -> Turbulence:
        """The section [turbulence], or what it is by default."""
        return self.scene.turbulence or Turbulence()

    @property
    def surface(self) -> Surface:
        """The section [surface], or what it is by default."""
        return self.scene.surface or Surface()

    @property
    def is_averaged(self) -> bool:
        """Whether turbulence is simulated by a model of the mean flow."""
        return self.scene.is_averaged

    @cached_property
    def walls(self) -> Walls:
        """Walls of a mean flow, and the inflow between them."""
        from ..turbulence.walls import walls_of

        datum = 0.0 if self.geometry.gdim == 2 else self.base_flow.datum
        ground = height_at_inflow(self.geometry, datum)
        return walls_of(self.geometry, self.base_flow, self.sides, ground, self.turbulence)

    @cached_property
    def ceiling(self) -> float:
        """Height of the upper side of what is meshed: below the layer of a wall on top."""
        return self.walls.ceiling if self.is_averaged else self.scene.domain.ceiling

    @cached_property
    def surroundings(self) -> Surroundings:
        """The boundaries that the grain may meet."""
        return surroundings_of(self.geometry, self.sides, self.ceiling, self.scene.has_surface)

    def faster(self, factor: float) -> Setup:
        """Makes the setup of a flow faster by a factor at the same viscosity, in units of that flow."""
        plain = self.scene.model_dump()
        plain["fluid"]["reynolds"] *= factor
        return Setup(Scene(**{**plain, "units": None}))

    @property
    def stress_unit(self) -> float:
        """(rho_s - rho_f) g d, by which the stress on the bed is divided for a Shields number."""
        scene = self.scene
        assert scene.grain is not None and scene.gravity is not None and scene.density is not None
        return (scene.density - 1.0) * scene.gravity.acceleration * scene.grain.size

    @property
    def has_bed_stress(self) -> bool:
        """Whether the base flow exerts a stress on a bed, which Shields numbers have."""
        return self.scene.bed is not None and self.scene.flow.kind in WITH_BED_STRESS

    def bed_stress(self, speed: float = 1.0) -> float:
        """Shear stress at the datum of a base flow `speed` times the scene's, in scene units with fluid density one.

        That of a mean flow is the inflow's. Not collective.
        """
        if not 0.0 < speed < float("inf"):
            return speed
        if not self.is_averaged:
            return self.base_flow_at(speed).bed_stress()
        faster = self if speed == 1.0 else self.faster(speed)
        return speed**2 * faster.walls.bed_shear_velocity**2


def order_of(scene: Scene) -> VelocityOrder:
    """The order of the velocity in a scene. Not collective."""
    return Setup(scene).order


def has_inertia(scene: Scene) -> bool:
    """Whether the flow of a scene has inertia. Not collective."""
    return Setup(scene).inertia.present
