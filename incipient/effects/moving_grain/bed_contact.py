"""Contact of a moving grain with its bed in each step: mode, work, trajectory.

Contact begins at the gap `contact.gap`, which keeps the flow in between resolved.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from ...arrays import Floats, spatial
from ...body.contact_motion import ActiveContacts, ContactLaw, ContactMotion
from ...body.rigidbody import RigidBody
from ...body.state import BodyState
from ...contact.acceleration import MODES, states_and_modes
from ...errors import SceneError
from ...geometry.contacts import ClosestPoints
from ...geometry.placement import Placement
from ...geometry.proximity import Proximity
from ...geometry.settle import SettlingOutcome, settle
from ...scene.model import Contact
from . import WORKS

REST, FLIGHT = "rest", "flight"
STILL = 1e-6  # velocity, relative to the flow's, that counts as zero
RESTED = 3  # steps without motion after which a grain rests
RISEN = 1e-3  # smallest rise, in grain sizes
SUNK = 0.5  # fraction of its highest position below which a grain returns into its pocket
ELSEWHERE = 0.05  # smallest distance of different rest positions, in grain sizes


@dataclass(frozen=True)
class Course:
    """History of a grain.

    first_motion, first_step: start and length of the first step with motion. rested: later steps
    without motion. left: time of leaving the pocket. heights: against gravity from the start, now
    and a step before; highest: so far. flow, gravity, friction, impact: work on the grain.
    """

    mode: str = REST
    first_motion: float | None = None
    first_step: float | None = None
    rested: int = 0
    left: float | None = None
    heights: tuple[float, float] = (0.0, 0.0)
    highest: float = 0.0
    flow: float = 0.0
    gravity: float = 0.0
    friction: float = 0.0
    impact: float = 0.0

    @property
    def sinks(self) -> bool:
        """Whether the grain, still in its pocket, is at rest or has come down by half."""
        return self.left is None and (self.mode == REST or self.heights[0] < SUNK * self.highest)

    @property
    def done(self) -> list[str]:
        left, rested = self.left is not None, self.rested >= RESTED
        return [*(["out-of-pocket"] if left else []), *(["at-rest"] if rested else [])]


class BedContact:
    """Contact of a moving grain with its bed; `gap` [length] of contact, submerged `weight` (gdim,), possibly zero."""

    def __init__(
        self,
        near: Proximity,
        gap: float,
        body: RigidBody,
        contact: Contact,
        speed: float,
        start: Placement,
        weight: Floats,
    ):
        law = ContactLaw(
            contact.friction,
            contact.kinetic_friction,
            contact.restitution,
            contact.rolling_resistance,
            contact.cohesion,
        )
        self.motion = ContactMotion(body, self._gaps, law, near.grain.size)
        self.course = Course()
        self._near, self._gap, self._still, self._weight = near, gap, STILL * speed, weight
        self._start = np.array(start.centre)

    def _gaps(self, placement: Placement, within: float) -> ClosestPoints:
        closest = self._near.gaps(placement, within + self._gap)
        return replace(closest, gaps=closest.gaps - self._gap)

    # -- each step --------------------------------------------------------------------------------

    def accept(
        self,
        ends: tuple[BodyState, BodyState],
        mean_load: Floats,
        weight: Floats,
        contacts: ActiveContacts,
    ) -> None:
        """Record a step between two states, with mean non-contact load and its constant part (k,)."""
        (before, after), course = ends, self.course
        now = self._mode(after, contacts)
        done = _works(before, after, mean_load, weight, contacts)
        works = {name: getattr(course, name) + work for name, work in done.items()}
        if course.first_motion is None and now != REST:
            course = replace(course, first_motion=before.time, first_step=after.time - before.time)
        rested = course.rested + 1 if now == REST and course.first_motion is not None else 0
        height = self._height(after)
        self.course = replace(course, mode=now, rested=rested, **works)
        if (
            course.left is None
            and self._over_the_top(height)
            and self._falls_elsewhere(after.placement)
        ):
            self.course = replace(self.course, left=after.time)
        highest = max(height, course.highest)
        self.course = replace(self.course, heights=(height, course.heights[0]), highest=highest)

    def _mode(self, state: BodyState, contacts: ActiveContacts) -> str:
        speeds = [
            np.linalg.norm(state.velocity),
            0.5 * self._near.grain.size * np.linalg.norm(state.spin),
        ]
        if max(speeds) <= self._still:
            return REST
        if not len(contacts):
            return FLIGHT
        turns = bool(speeds[1] > self._still)
        spin = state.spin if len(state.spin) == 3 else np.array([0.0, 0.0, state.spin[0]])
        normals = np.array([spatial(one) for one in contacts.normals])
        motion, turning = spatial(contacts.velocities)[None], (float(turns) * spin)[None]
        still = np.array([[self._still]])
        slow = still / self._near.grain.size
        modes = states_and_modes(motion, normals[None], turning, still, slow)[1]
        return MODES[modes[0]].label

    # -- the pocket -------------------------------------------------------------------------------

    def _height(self, state: BodyState) -> float:
        heavy = float(np.linalg.norm(self._weight))
        return float((state.place - self._start) @ -self._weight) / heavy if heavy else 0.0

    def _over_the_top(self, height: float) -> bool:
        last, before = self.course.heights
        return last > RISEN * self._near.grain.size and height < last >= before

    def _falls_elsewhere(self, placement: Placement) -> bool:
        """Whether the grain, released without flow and friction, settles elsewhere than at the start."""
        near, size = self._near, self._near.grain.size
        first = Placement(tuple(self._start), placement.angle, placement.quaternion)
        try:
            rests = [
                settle(near.grain, near.bed, one, self._weight, 0.0) for one in (first, placement)
            ]
        except SceneError:
            return False
        if rests[1].outcome is SettlingOutcome.ROLLS_OFF:
            return True
        way = np.subtract(rests[1].placement.centre, rests[0].placement.centre)
        return bool(np.linalg.norm(way) > ELSEWHERE * size)

    # -- output -----------------------------------------------------------------------------------

    def columns(self, contacts: ActiveContacts) -> dict[str, float | int | str]:
        slip = np.hypot(*contacts.velocities[:, 1:].T) if len(contacts) else np.zeros(1)
        course = self.course
        return {
            "contacts": len(contacts),
            "slip": float(slip.max()),
            "mode": course.mode,
            **{f"work_{name}": getattr(course, name) for name in WORKS},
        }

    def reported(self) -> dict[str, Any]:
        course = self.course
        times = {name: getattr(course, name) for name in ("mode", "first_motion", "first_step")}
        works = {name: getattr(course, name) for name in WORKS}
        return {**times, "left_pocket": course.left, "works": works}

    # -- checkpoints ------------------------------------------------------------------------------

    def stored(self, contacts: ActiveContacts) -> dict[str, Any]:
        named = {name: value.tolist() for name, value in vars(contacts).items() if name != "work"}
        return {"contacts": named, "course": asdict(self.course), "done": self.course.done}

    def restore(self, kept: dict[str, Any]) -> ActiveContacts:
        course = kept["course"]
        self.course = Course(**{**course, "heights": tuple(course["heights"])})
        gdim = len(self._start)
        sizes = {"points": gdim, "normals": gdim, "impulses": 3, "velocities": 3, "rolling": 2}
        points, normals, impulses, velocities, torques = (
            np.array(kept["contacts"][name]).reshape(-1, size) for name, size in sizes.items()
        )
        return ActiveContacts(points, normals, impulses, velocities, torques)


def _works(
    before: BodyState, after: BodyState, mean_load: Floats, weight: Floats, contacts: ActiveContacts
) -> dict[str, float]:
    way = 0.5 * (after.time - before.time) * (before.velocities + after.velocities)
    gravity = float(weight @ way)
    return dict(
        zip(WORKS, (float(mean_load @ way) - gravity, gravity, *contacts.work), strict=True)
    )
