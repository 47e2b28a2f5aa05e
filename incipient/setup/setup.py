"""A scene with its derived parts and dimensionless numbers, each derived once, before meshing and computation."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from operator import attrgetter
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import Floats, point
from ..geometry.placement import Placement
from ..geometry.plane.closest import Closing, closing
from ..geometry.settle import touching_under
from ..meshes import Resolved
from ..scene import Scene, Surface
from ..scene.expression import of_time
from ..scene.rules import distances_from_sides
from .base_flow import KINDS, BaseFlow, at_rest_on
from .geometry import HIGHEST, Clearance, Place, SideNames, Stance

if TYPE_CHECKING:
    from ..contact import Contacts
    from ..turbulence.walls import Walls

SAMPLES = 33  # of times, and of heights, at which a flow is sampled
MOST_INSTANTS = 1_000_000  # at which formulas are sampled, also of runs that nobody can wait for


@dataclass(frozen=True)
class Numbers:
    """A scene's dimensionless numbers; None where a number does not apply."""

    # Speed of the flow past the grain times its largest diameter over the viscosity
    grain_reynolds: float | None = None
    flow_reynolds: float = 0.0  # reference velocity times height of the domain over the viscosity
    # Speed at the height of the bed's relief above the datum times that height over the viscosity
    bed_reynolds: float | None = None
    reach: float = 0.0  # extent of the grain's disturbance up to a wall, in grain sizes
    density_ratio: float | None = None  # density of a free or weighing grain over the fluid's
    # Density ratio times grain Reynolds number / 18: the Stokes number of the grain
    stokes: float | None = None
    # Mean velocity over sqrt(g depth), g across the bed, the depth from the datum
    froude: float | None = None
    # Shear velocity of the base flow at its datum times the grain's largest diameter over the viscosity
    shear_reynolds: float | None = None
    # That stress over the submerged weight of the grain, (rho_s - rho_f) g d
    shields: float | None = None
    of_flow: dict[str, float] = field(default_factory=dict)  # of its kind alone, by name

    @property
    def named(self) -> dict[str, float | None]:
        """The numbers that plans and reports show."""
        return {
            "grain Re": self.grain_reynolds,
            "flow Re": self.flow_reynolds,
            "bed Re": self.bed_reynolds,
            "density ratio": self.density_ratio,
            "Stokes": self.stokes,
            "Froude": self.froude,
            "Re*": self.shear_reynolds,
            "Shields number": self.shields,
            **self.of_flow,
        }

    def text(self) -> str:
        notes = {"grain Re": " (largest speed past it)"}
        return ", ".join(
            f"{name} {value:.3g}{notes.get(name, '')}"
            for name, value in self.named.items()
            if value is not None
        )


@dataclass(frozen=True, eq=False)
class Setup:
    """A scene and its parts, each made on first use; modules of absent parts are never imported.

    No method is collective.
    """

    scene: Scene

    @property
    def symmetric(self) -> bool:
        """Whether half of the domain is computed."""
        return self.scene.domain.symmetric is not False and self.mirrored

    @property
    def mirrored(self) -> bool:
        """Whether the flow is its own mirror image: in the whole domain unsteady flow may break the symmetry."""
        scene = self.scene
        holds = scene.time is None or scene.domain.symmetric is not False
        return scene.gdim == 3 and holds and not scene.asymmetry

    @cached_property
    def numbers(self) -> Numbers:
        """The scene's dimensionless numbers."""
        scene, base_flow, flow = self.scene, self.base_flow, self.scene.flow
        viscosity, height, grain = scene.viscosity, scene.domain.height, scene.grain
        gravity, relief = (
            float(abs(scene.gravity_vector[scene.up])),
            float(np.ptp(scene.bed_heights)),
        )
        numbers = dict[str, Any]()
        if not flow.at_rest:
            # The mean speed of shear is that over the grain's size.
            over = flow.reference_velocity(height if grain is None else grain.size)
            velocity = flow.reference_velocity(height) / over * base_flow.mean_speed
            numbers["flow_reynolds"] = velocity * height / viscosity
            numbers["froude"] = velocity / math.sqrt(gravity * base_flow.depth) if gravity else None
        if relief:
            levels = base_flow.datum, base_flow.datum + relief
            speed = self._largest_speed(scene.domain.entrance, levels)
            numbers["bed_reynolds"] = speed * relief / viscosity
        if grain is None:
            return Numbers(**numbers)
        assert scene.placement is not None
        size, centre, ratio = grain.size, scene.placement.centre, scene.density
        levels = centre[scene.up] - 0.5 * size, centre[scene.up] + 0.5 * size
        past = self._largest_speed(centre, levels, base_flow.instants(SAMPLES))
        reynolds = max(past, self._own_speed()) * size / viscosity
        if scene.bed is not None and flow.stresses_bed and base_flow.gust is None:
            stress = self.bed_stress()
            numbers["shear_reynolds"] = math.sqrt(stress) * size / viscosity
            if ratio is not None and ratio > 1.0 and scene.gravity and self.stress_unit > 0.0:
                numbers["shields"] = stress / self.stress_unit
        return Numbers(
            grain_reynolds=reynolds,
            reach=self._wall_distance() + 0.5,
            density_ratio=ratio,
            stokes=None if ratio is None else ratio * reynolds / 18.0,
            of_flow=flow.numbers(size, viscosity),
            **numbers,
        )

    def _largest_speed(
        self,
        place: Sequence[float],
        levels: tuple[float, float],
        times: Sequence[float] | Floats = (0.0,),
    ) -> float:
        """Largest speed of the base flow, of a mean flow that of its inflow, between two levels over a place."""
        if not self.scene.is_averaged:
            return float(np.abs(self.base_flow.sampled(place, *levels, times)).max())
        points = self.base_flow.column(place, np.linspace(*levels, SAMPLES))
        return float(np.abs(self.walls.inflow.velocity(points)).max())

    def _own_speed(self) -> float:
        """Estimated speed of the grain: prescribed, initial, or settling (Stokes, capped by free fall)."""
        scene, body, size = self.scene, self.scene.body, self.scene.grain.size
        if body is None or not body.moves:
            return 0.0
        if body.course is not None:
            course = self.prescribed(self.base_flow.instants(SAMPLES))[-1]
            parts = np.split(course, [scene.gdim], axis=1)
            return float(sum(np.linalg.norm(part, axis=1) for part in parts).max())
        drive = abs((scene.density or 0.0) - 1.0) * float(abs(scene.gravity_vector).max())
        settling = min(drive * size**2 / (18.0 * scene.viscosity), math.sqrt(drive * size))
        initial = np.linalg.norm(body.velocity) + 0.5 * size * np.linalg.norm(body.spin)
        return max(settling, float(initial))

    def prescribed(self, times: Floats) -> list[Floats]:
        """Velocities (times, ...) that formulas prescribe: at the inflow, and of the grain, its spin at its surface."""
        scene, domain, velocities = self.scene, self.scene.domain, []
        if scene.flow.by_formulas:
            column = domain.entrance, domain.bottom, domain.ceiling
            velocities.append(self.base_flow.sampled(*column, times, 5))
        if scene.body is not None and scene.body.course is not None:
            course = of_time(scene.body.course, "body.course")(times).T
            course[:, scene.gdim :] *= 0.5 * scene.grain.size
            velocities.append(course)
        return velocities

    def instants(self, in_step: int) -> Floats:
        """Times from zero to the end of a run, so many in each step."""
        time = self.scene.time
        assert time is not None
        number = min(math.ceil(in_step * time.end / time.step), MOST_INSTANTS)
        return np.linspace(0.0, time.end, number + 1)

    def times_of(self, events: Callable[[Floats, Floats], Floats]) -> Floats:
        """Times of events, such as `kinks`, of the velocities that formulas prescribe."""
        times = self.instants(10)
        return np.concatenate([[], *(events(each, times) for each in self.prescribed(times))])

    def _wall_distance(self) -> float:
        """Extent of the grain's disturbance up to a wall, from its surface, in its sizes."""
        scene, domain, walled = self.scene, self.scene.domain, self.scene.top == "wall"
        if scene.rests or scene.placement is None:
            return 0.0
        y = scene.placement.centre[scene.up]
        bounded = scene.bed or domain.kind == "box" or walled or scene.flow.wall_below
        below = y - self.base_flow.datum if bounded else domain.height
        above = domain.ceiling - y if walled else domain.height
        return max(min(below, above, domain.height) / scene.grain.size - 0.5, 0.0)

    @cached_property
    def sides(self) -> SideNames:
        """Names of the sides of the domain, or of the half that is meshed."""
        in_space, across = self.scene.gdim == 3, ("left",) if self.symmetric else ("right", "left")
        ends = ("outflow", "inflow")
        if self.scene.domain.kind == "box":
            ends = ("downstream", "upstream") if in_space else ("right", "left")
        bottom = "bottom" if self.scene.bed is None else "bed"
        return SideNames(bottom, ends[0], "top", ends[1], across if in_space else ())

    @cached_property
    def base_flow(self) -> BaseFlow:
        return KINDS.get(self.scene.flow.kind, BaseFlow)(self.scene)

    def base_flow_at(self, speed: float) -> BaseFlow:
        """The flow faster by a factor, in its own units: only the datum may differ."""
        return self.base_flow if speed == 1.0 else replace(self.base_flow, speed=speed)

    @property
    def surface(self) -> Surface:
        return self.scene.surface or Surface()

    @cached_property
    def walls(self) -> Walls:
        from ..turbulence.walls import walls_of

        return walls_of(self.scene, self.sides, self.mean_flow_datum())

    def mean_inflow(self, x: np.ndarray, t: float) -> np.ndarray:
        """Inflow velocity (gdim, n) of a turbulent flow at (3, n); at rest on a bed above its datum."""
        left, walls = self.scene.domain.left, self.walls
        return at_rest_on(self.scene, [left], walls.datum, walls.inflow.velocity, x)

    @property
    def pinned_sides(self) -> tuple[str, ...]:
        """Sides to which fluid below a free surface sticks, and where its elevation is fixed."""
        return () if self.scene.sides == "slip" else self.sides.across

    @cached_property
    def ceiling(self) -> float:
        """Height of the upper side of the mesh: below the layer of a wall on top."""
        return self.walls.ceiling if self.scene.is_averaged else self.scene.domain.ceiling

    def resolved_bed(self, placement: Placement | None) -> Resolved | None:
        """The region about a held grain in which 3-D bedforms are meshed; None: everywhere.

        Beyond it the bed is planar, at the datum.
        """
        scene, domain, bed = self.scene, self.scene.domain, self.scene.bed_shape
        if scene.gdim == 2 or scene.moves or placement is None or math.isinf(bed.feature):
            return None
        # Three grain sizes; 1.5 on much smaller forms, of which a grain sees many alike; never fewer than three forms.
        radius = np.clip(30.0 * bed.feature, 1.5 * scene.grain.size, 3.0 * scene.grain.size)
        radius = scene.numerics.meshed_bed * float(max(radius, 3.0 * bed.feature))
        passage = 2.0 * bed.feature
        x, y = placement.centre[:2]
        sides = (x - domain.left, domain.right - x, *np.abs(np.subtract(domain.across, y)))
        if radius + passage >= max(sides):
            return None
        return Resolved((x, y), radius, passage, self.base_flow.datum)

    def mean_flow_datum(self) -> float:
        """Height at which a turbulent inflow starts.

        That of the planar far bed, the mean height of repeated bedforms (as of Nikuradse 1933, VDI-Forschungsheft 361),
        or the height of another bed at the inflow, in 3-D the mean there.
        """
        domain = self.scene.domain
        if resolved := self.resolved_bed(self.scene.placement):
            return resolved.level
        if self.scene.repeats_forms:
            return self.scene.bed_shape.mean(*domain.spans)
        y = np.zeros(1) if self.scene.gdim == 2 else np.linspace(*domain.across, 2000)
        inflow = np.column_stack([np.full_like(y, domain.left), y])
        return float(self.scene.bed_height(inflow).mean())

    @property
    def half(self) -> tuple[float, float]:
        low, high = self.scene.domain.across
        return (self.scene.domain.middle if self.symmetric else low), high

    @cached_property
    def contacts(self) -> Contacts:
        assert self.scene.placement is not None
        return touching_under(
            self.scene.near_bed,
            self.scene.placement,
            self.scene.gravity_direction,
            self.scene.contact_tolerance,
        )

    @cached_property
    def stance(self) -> Stance:
        """The grain where it rests or is held; on a bed it is lifted by the gap, or closed next to its contacts."""
        scene, resting = self.scene, self.scene.placement
        if scene.closes_contacts:
            line = self.closing.left
            return Stance(
                resting, resting, self.closing.width, (line.start, line.end), self.closing
            )
        if resting is None or (scene.bed is None and not scene.moves):
            return Stance(resting, resting)
        if not scene.rests:
            return self.stance_at(resting)
        if not scene.moves:
            return self.stance_at(self.off_bed(resting), resting)
        raised = scene.near_bed.with_gap(resting, scene.contact_gap, self.contacts.points)
        return self.stance_at(raised, resting)

    def stance_at(self, placement: Placement, resting: Placement | None = None) -> Stance:
        """The stance of a grain at a placement, with its gap from the bed, of a moving grain also from sides."""
        near = self.clearance(placement) if self.scene.moves else self.bed_clearance(placement)
        ends = self.halved(near.on_grain), self.halved(near.on_other)
        return Stance(resting or placement, placement, near.distance, ends)

    def off_bed(self, placement: Placement) -> Placement:
        """The placement of a held grain raised until it has the gap, or moved along the normals of steep contacts."""
        gap, up, near_bed = self.scene.contact_gap, self.scene.up, self.scene.near_bed
        raised = near_bed.lowered(placement, gap)
        if raised.centre[up] - placement.centre[up] <= HIGHEST * gap:
            return raised
        near = near_bed.gaps(placement, gap).points  # beside contacts it may be nearly as close
        moved = near_bed.with_gap(placement, gap, near)
        shift = np.linalg.norm(np.subtract(moved.centre, placement.centre))
        is_apart = near_bed.clearance(moved)[0] >= 0.5 * gap  # not where contacts wedge it
        return moved if is_apart and shift <= HIGHEST * gap else raised

    @cached_property
    def closing(self) -> Closing:
        """Closing of the space below the resting grain.

        Raises SceneError if the grain does not touch the bed, or the space is nowhere wider than the gap.
        """
        scene, placement = self.scene, self.scene.placement
        assert placement is not None
        outline = tuple(curve.moved(placement) for curve in scene.grain.chain.curves)
        return closing(outline, scene.bed_shape, self.contacts.points[:, :2], scene.contact_gap)

    def gap_points(self, stance: Stance) -> tuple[Place, ...]:
        """Points where grain and bed nearly touch: the narrowest one, and every contact of a resting grain."""
        scene, ends, placement = self.scene, stance.gap_ends, stance.placement
        assert ends is not None and placement is not None
        if closing := stance.closing:
            left, right = closing.left, closing.right
            return left.start, left.end, right.start, right.end
        if scene.body is not None and scene.body.touches:
            # Up to three times the gap at contact the space is meshed as narrow.
            near = scene.near_bed.gaps(placement, 3.0 * scene.contact_gap).points
            return tuple(dict.fromkeys([*ends, *(self.halved(point(x)) for x in near)]))
        if not scene.rests:
            return ends if scene.moves and scene.gdim == 2 else ends[:1]
        contacts = self.contacts.points[:, : scene.gdim]
        return tuple(dict.fromkeys([ends[0], *(point(x) for x in contacts)]))

    def halved(self, x: Place) -> Place:
        """The point, or in a halved domain its mirror image with larger y."""
        if not self.symmetric:
            return x
        return x[0], self.scene.domain.middle + abs(x[1] - self.scene.domain.middle), x[2]

    def clearance(
        self, placement: Placement, within: float = math.inf, from_bed: bool = True
    ) -> Clearance:
        """Smallest distance [length] of the placed grain from sides and bed; negative beyond them.

        The distance of the bed is computed only if it may be below `within`, and that of bed or bottom `from_bed`.
        """
        scene, sides, axes = self.scene, self.sides, np.eye(self.scene.gdim)
        names = {
            **dict(zip([(1, 1), (1, -1)], sides.across[::-1], strict=False)),
            (0, -1): sides.left,
            (0, 1): sides.right,
            (scene.up, 1): "" if scene.has_surface else sides.top,
            (scene.up, -1): sides.bottom if from_bed and scene.bed is None else "",
        }
        distances = distances_from_sides(scene, placement, self.ceiling)
        clearances = [
            Clearance(distance, point(x), point(x + end * distance * axes[axis]), name)
            for (axis, end), name in names.items()
            if name
            for x, distance in [distances[axis, end]]
        ]
        lowest = scene.domain.bottom + distances[scene.up, -1][1]
        if from_bed and scene.bed is not None and lowest - scene.bed_shape.crest < within:
            clearances.append(self.bed_clearance(placement))
        return min(clearances, key=attrgetter("distance"))

    def bed_clearance(self, placement: Placement) -> Clearance:
        """Smallest distance [length] of the placed grain from the bed."""
        gap, on_grain, on_bed = self.scene.near_bed.clearance(placement)
        return Clearance(gap, point(on_grain), point(on_bed), self.sides.bottom)

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
        if not self.scene.is_averaged:
            return self.base_flow_at(speed).bed_stress()
        faster = self if speed == 1.0 else self.faster(speed)
        return speed**2 * faster.walls.bed_shear_velocity**2


def time_of_change(base_flow: BaseFlow) -> float | None:
    """Largest speed of the base flow over its largest rate of change, or None."""
    scene, domain = base_flow.scene, base_flow.scene.domain
    if scene.time is None or not scene.flow.changes:
        return None
    times = base_flow.instants(4 * SAMPLES)
    speeds = base_flow.sampled(domain.entrance, domain.bottom, domain.ceiling, times)
    rate = float(np.abs(np.gradient(speeds, times, axis=0)).max())
    return float(np.abs(speeds).max()) / rate if rate > 0.0 else None
