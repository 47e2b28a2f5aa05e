"""The geometry of a scene: placed grain, bed, the names of the sides of the domain, and the grain as a rigid body."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ..geometry.placement import Placement
from ..geometry.plane.closest import Closing, closing
from ..geometry.settle import touching_under
from ..meshes import SYMMETRY
from ..scene import Body, Scene
from ..scene.expression import of_time
from ..scene.grains import inertia_tensor, mass

if TYPE_CHECKING:
    from ..body.rigidbody import RigidBody
    from ..body.state import BodyState
    from ..contact import Contacts

# Names of the lines that close the space below a grain, upstream and downstream of its contacts.
CLOSED = ("closed upstream", "closed downstream")
DEGREES = {2: ("x", "y", "angle"), 3: ("x", "y", "z", "rx", "ry", "rz")}
# Gaps by which a held grain is raised at most: by more it would be another, more exposed one.
HIGHEST = 5.0
Place = Any  # a point (gdim,) as a tuple of numbers


@dataclass(frozen=True)
class Stance:
    """Placement of a grain."""

    resting: Placement | None = None  # where it touches the bed or is held; None without a grain
    placement: Placement | None = None  # where the flow is computed: a gap away from the bed
    gap: float = np.inf  # smallest distance from the bed in that flow [length], inf without contact
    gap_ends: tuple[Place, Place] | None = None  # the two points between which the gap is measured
    closing: Closing | None = None  # the closed space next to the contacts; None: open


@dataclass(frozen=True)
class Clearance:
    """Smallest distance of grain and surroundings, its position, and the side or bed."""

    distance: float
    on_grain: Place
    on_other: Place
    other: str


@dataclass(frozen=True, eq=False)
class Geometry:
    """Grain and bed in the domain."""

    scene: Scene
    symmetric: bool  # whether half of the domain is computed

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
        """The grain where it rests or is held; on a bed it is lifted by the gap."""
        scene, placement = self.scene, self.scene.placement
        if placement is None or scene.bed is None:
            return Stance(placement, placement)
        if scene.rests and scene.moves:
            placement = scene.near_bed.with_gap(placement, scene.contact_gap, self.contacts.points)
        elif scene.rests:
            placement = self.off_bed(placement)
        gap, on_grain, on_bed = scene.near_bed.clearance(placement)
        ends = self.halved(point(on_grain)), self.halved(point(on_bed))
        return Stance(scene.placement, placement, gap, ends)

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

    def gap_points(self, ends: tuple[Place, Place], placement: Placement) -> tuple[Place, ...]:
        """Points where grain and bed nearly touch: the narrowest one, and every contact of a resting grain."""
        scene = self.scene
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


def point(x: Any) -> Any:
    """The coordinates (gdim,) as a tuple of plain numbers."""
    return tuple(float(coordinate) for coordinate in x)


@dataclass(frozen=True)
class SideNames:
    """Names of the sides of a domain."""

    bottom: str  # "bed" where there is one
    right: str  # like `left` an end of the base flow
    top: str
    left: str
    across: tuple[str, ...] = ()  # in 3-D, at least and largest y; of half a domain only the latter

    @property
    def of_grid(self) -> tuple[str, ...]:
        across = (SYMMETRY, *self.across) if len(self.across) == 1 else self.across
        return self.left, self.right, *across, self.bottom, self.top


def rigid_body(body: Body, symmetric: bool = False) -> RigidBody:
    """Mass, moments and freedom of a moving grain; `symmetric`: half of it is in the flow."""
    from ..body.rigidbody import RigidBody
    from ..body.state import Freedom, Inertia

    if body.course is None:
        # In half of a symmetric scene a grain and its mirror image move alike.
        held = {*body.locked, *(("y", "rx", "rz") if symmetric else ())}
        freedom = Freedom(tuple(name not in held for name in DEGREES[body.gdim]))
    else:
        freedom = Freedom.none(body.gdim, of_time(body.course, "body.course"))
    inertia = Inertia.about(mass(body) or 0.0, inertia_tensor(body), body.gdim)
    return RigidBody(inertia, freedom)


def initial_state(body: Body, placement: Placement, symmetric: bool = False) -> BodyState:
    """Position and velocities of a moving grain at time zero."""
    from ..body.state import BodyState

    velocities = np.concatenate([np.atleast_1d(body.velocity), np.atleast_1d(body.spin)])
    return rigid_body(body, symmetric).consistent(BodyState.at(placement, velocities))
