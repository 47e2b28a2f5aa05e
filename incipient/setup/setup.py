"""A scene with its derived parts before meshing and computation, each derived once."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from ..scene import Scene, Surface, Turbulence
from ..scene.symmetry import differences
from .base_flow import KINDS, BaseFlow
from .geometry import Geometry, SideNames, side_names
from .numbers import Numbers, numbers_of
from .surroundings import Surroundings

if TYPE_CHECKING:
    from ..turbulence.walls import Walls


@dataclass(frozen=True, eq=False)
class Setup:
    """A scene and its parts, each made on first use; modules of absent parts are never imported.

    No method is collective.
    """

    scene: Scene

    @cached_property
    def geometry(self) -> Geometry:
        return Geometry(self.scene, self.symmetric)

    @cached_property
    def symmetric(self) -> bool:
        asked = self.scene.domain.symmetric
        if self.scene.gdim == 2 or asked is False:
            return False
        return asked is True or next(differences(self.scene), None) is None

    @cached_property
    def numbers(self) -> Numbers:
        return numbers_of(self)

    @cached_property
    def sides(self) -> SideNames:
        return side_names(self.scene.domain, self.scene.bed is not None, self.symmetric)

    @cached_property
    def base_flow(self) -> BaseFlow:
        return self.base_flow_at(1.0)

    def base_flow_at(self, speed: float) -> BaseFlow:
        """The flow faster by a factor, in its own units: only the datum may differ."""
        return KINDS.get(self.scene.flow.kind, BaseFlow)(self.scene, speed)

    @property
    def turbulence(self) -> Turbulence:
        return self.scene.turbulence or Turbulence()

    @property
    def surface(self) -> Surface:
        return self.scene.surface or Surface()

    @property
    def is_averaged(self) -> bool:
        return self.scene.is_averaged

    @cached_property
    def walls(self) -> Walls:
        from ..turbulence.walls import walls_of

        datum = 0.0 if self.scene.gdim == 2 else self.base_flow.datum
        ground = self.geometry.height_at_inflow(datum)
        return walls_of(self.scene, self.sides, ground, self.turbulence)

    @property
    def pinned_sides(self) -> tuple[str, ...]:
        """Sides to which fluid below a free surface sticks, and where its elevation is fixed."""
        ends = (self.sides.left, self.sides.right) if self.surface.ends == "no-slip" else ()
        return ends if self.scene.sides == "slip" else (*ends, *self.sides.across)

    @cached_property
    def ceiling(self) -> float:
        """Height of the upper side of the mesh: below the layer of a wall on top."""
        return self.walls.ceiling if self.is_averaged else self.scene.domain.ceiling

    @cached_property
    def surroundings(self) -> Surroundings:
        return Surroundings(self)

    def faster(self, factor: float) -> Setup:
        """The setup of a flow faster by a factor at the same viscosity, in units of that flow."""
        plain = self.scene.model_dump()
        plain["fluid"]["reynolds"] *= factor
        return Setup(Scene(**{**plain, "units": None}))

    @property
    def stress_unit(self) -> float:
        """(rho_s - rho_f) g d, the unit of bed stress in a Shields number."""
        scene = self.scene
        assert scene.grain is not None and scene.gravity is not None and scene.density is not None
        return (scene.density - 1.0) * scene.gravity.acceleration * scene.grain.size

    def bed_stress(self, speed: float = 1.0) -> float:
        """Shear stress at the datum of a base flow `speed` times the scene's, with fluid density one.

        For a mean flow that of the inflow.
        """
        if not 0.0 < speed < float("inf"):
            return speed
        if not self.is_averaged:
            return self.base_flow_at(speed).bed_stress()
        faster = self if speed == 1.0 else self.faster(speed)
        return speed**2 * faster.walls.bed_shear_velocity**2
