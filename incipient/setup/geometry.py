"""The geometry of a scene: placed grain, bed, the names of the sides of the domain, and the grain as a rigid body."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..geometry.placement import Placement
from ..geometry.plane.closest import Closing
from ..meshes import SYMMETRY
from ..scene import Body
from ..scene.expression import of_time
from ..scene.grains import inertia_tensor, mass

if TYPE_CHECKING:
    from ..body.rigidbody import RigidBody
    from ..body.state import BodyState

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
    from ..body.state import Inertia

    course = None if body.course is None else of_time(body.course, "body.course")
    # In half of a symmetric scene a grain and its mirror image move alike.
    held = {*body.locked, *(("y", "rx", "rz") if symmetric else ())}
    free = [course is None and name not in held for name in DEGREES[body.gdim]]
    inertia = Inertia.about(mass(body) or 0.0, inertia_tensor(body), body.gdim)
    return RigidBody(inertia, free, course)


def initial_state(body: Body, placement: Placement, symmetric: bool = False) -> BodyState:
    """Position and velocities of a moving grain at time zero."""
    from ..body.state import BodyState

    velocities = np.concatenate([np.atleast_1d(body.velocity), np.atleast_1d(body.spin)])
    return rigid_body(body, symmetric).consistent(BodyState.at(placement, velocities))
