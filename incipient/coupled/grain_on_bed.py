"""Grain that rolls, slides and rests on its bed, and leaves its pocket.

Contact begins at the gap `contact.gap`, which keeps the flow in between resolved.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from ..arrays import SMALLEST, Floats, spatial
from ..body.contact_motion import ActiveContacts, ContactLaw, ContactMotion, ContactStep
from ..body.state import BodyState
from ..contact.acceleration import MODES, states_and_modes
from ..errors import SceneError
from ..fluid import Fluid
from ..fluid.transient import TimeStep, Transient
from ..geometry.contacts import ClosestPoints
from ..geometry.placement import Placement
from ..geometry.settle import SettlingOutcome, settle
from ..mesh.motion import MeshMotion
from ..results.loads import columns_of_load, named, whole
from ..results.of_runs import WORKS
from ..setup.setup import Setup
from .moving_grain import MovingGrain

if TYPE_CHECKING:
    from ..restart import Checkpoint

# Largest advance, in gaps, of a new mesh ahead of a grain on its bed, by dimension: beyond, cells fold on the way back,
# in 3-D at 1.2 on cells 2.2 times as large (demos/scenes/sphere_leaving_pocket.toml).
AHEAD = {2: 3.0, 3: 0.3}
IN_POCKET = "in-pocket"  # returning or at rest after a gust
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
    and a step before; highest: so far. works: on the grain, as in `WORKS`.
    """

    mode: str = REST
    first_motion: float | None = None
    first_step: float | None = None
    rested: int = 0
    left: float | None = None
    heights: tuple[float, float] = (0.0, 0.0)
    highest: float = 0.0
    works: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0)

    @property
    def sinks(self) -> bool:
        """Whether the grain, still in its pocket, is at rest or has come down by half."""
        return self.left is None and (self.mode == REST or self.heights[0] < SUNK * self.highest)

    @property
    def done(self) -> list[str]:
        left, rested = self.left is not None, self.rested >= RESTED
        return [*(["out-of-pocket"] if left else []), *(["at-rest"] if rested else [])]


class GrainOnBed(MovingGrain):
    """Moving grain in contact with its bed: contact impulses act within each coupling iteration.

    course: its history; contacts: at the end of the last step
    """

    def __init__(self, setup: Setup, *others: Any):
        contact = setup.scene.contact
        assert contact is not None
        self.course = Course()
        self._near, self._gap = setup.scene.near_bed, setup.scene.contact_gap
        super().__init__(setup, *others)
        self.law = ContactLaw(
            contact.friction,
            contact.kinetic_friction,
            contact.restitution,
            contact.rolling_resistance,
            contact.cohesion,
        )
        self._contact = ContactMotion(self.body, self._gaps, self.law, self.grain.size)
        self.contacts = self._contact.closed(self.state.placement)
        self._step: ContactStep | None = None
        self._length = 0.0

    def _gaps(self, placement: Placement, within: float) -> ClosestPoints:
        closest = self._near.gaps(placement, within + self._gap)
        return replace(closest, gaps=closest.gaps - self._gap)

    def mesh_placements(self) -> list[Placement]:
        """The first one near contact is up to half the next step ahead, with less shear of cells in the gap."""
        here, now, length = super().mesh_placements(), self.state, self.last_step()
        if length is None or not len(self._gaps(now.placement, self._gap)):
            return here
        end = self.predicted(length, 2)
        way, turn = end.place - now.place, end.placement.turn_since(now.placement)
        longest = float(
            np.linalg.norm(way) + 0.5 * self.grain.size * np.linalg.norm(turn) * self.turns_mesh
        )
        share = min(0.5, AHEAD[self.body.gdim] * self._gap / max(longest, SMALLEST))
        return [self.rounded(now.placement.moved(share * way, share * turn)), *here]

    # -- the run ----------------------------------------------------------------------------------

    def predicted(self, length: float, order: int) -> BodyState:
        return self._contact.kept_out(super().predicted(length, order))

    def _moved(self, length: float, mean: Floats, added: Floats, guess: Floats) -> BodyState:
        tried = self._step if self._length == length else None
        step = self._contact.step(self.state, length, mean, added, guess, self.contacts, tried)
        self._motion, self._step, self._length = step.motion, step, length
        return step.end

    def on(self, fluid: Fluid, motion: MeshMotion, made_for: Placement) -> Self:
        new = super().on(fluid, motion, made_for)
        new.contacts, new.course = self.contacts, self.course
        return new

    def accept(self, step: TimeStep) -> None:
        super().accept(step)
        if self._step is not None:
            self.contacts = self._step.contacts
        self._step = None  # as in a resumed run
        (after, before, *_), course = self.past, self.course
        mode, height = self._mode(after), self._height(after)
        if course.first_motion is None and mode != REST:
            course = replace(course, first_motion=before.time, first_step=after.time - before.time)
        rested = course.rested + 1 if mode == REST and course.first_motion is not None else 0
        last, earlier = course.heights
        way = 0.5 * (after.time - before.time) * (before.velocities + after.velocities)
        gravity = float(self._weight() @ way[: self.body.gdim])
        flow = float(self.mean_load.previous @ way) - gravity + self.contacts.returned
        works = flow, gravity, *self.contacts.work
        now = replace(
            course,
            mode=mode,
            rested=rested,
            heights=(height, last),
            highest=max(height, course.highest),
            works=tuple(np.add(course.works, works).tolist()),
        )
        risen = RISEN * self.grain.size
        over_the_top = last > risen and height < last >= earlier
        # A grain that flies may pass the ridge after its highest position.
        begins_to_sink = now.highest > risen and now.sinks and not course.sinks
        turns = over_the_top or begins_to_sink
        if now.left is None and turns and self._falls_elsewhere(after.placement):
            now = replace(now, left=after.time)
        self.course = now

    def _mode(self, state: BodyState) -> str:
        contacts, size = self.contacts, self.grain.size
        still = STILL * self.scene.reference_velocity
        turning = 0.5 * size * np.linalg.norm(state.spin)
        if max(np.linalg.norm(state.velocity), turning) <= still:
            return REST
        if not len(contacts):
            return FLIGHT
        motion, normals = spatial(contacts.velocities), spatial(contacts.normals)
        spin, slow = float(turning > still) * whole(state.velocities)[3:], np.array([[still]])
        modes = states_and_modes(motion[None], normals[None], spin[None], slow, slow / size)[1]
        return MODES[modes[0]].label

    def _height(self, state: BodyState) -> float:
        weight, start = self._weight(), self.setup.stance.placement
        heavy = float(np.linalg.norm(weight))
        assert start is not None
        return float((state.place - np.array(start.centre)) @ -weight) / heavy if heavy else 0.0

    def _falls_elsewhere(self, placement: Placement) -> bool:
        """Whether the grain, released without flow and friction, settles elsewhere than at the start."""
        near, start = self._near, self.setup.stance.placement
        assert start is not None
        first = Placement(start.centre, placement.angle, placement.quaternion)
        try:
            rests = [
                settle(near.grain, near.bed, pose, self._weight(), 0.0)
                for pose in (first, placement)
            ]
        except SceneError:
            return False
        if rests[1].outcome is SettlingOutcome.ROLLS_OFF:
            return True
        way = np.subtract(rests[1].placement.centre, rests[0].placement.centre)
        return bool(np.linalg.norm(way) > ELSEWHERE * self.grain.size)

    @property
    def does(self) -> str:  # type: ignore[override]
        """Motion in the last step: a mode, "flight" or "rest"."""
        return self.course.mode

    @property
    def ends(self) -> str:
        """Event that ends the run, as in `time.until`, "contact" or IN_POCKET; or ""."""
        until, course, gust = self.time.until, self.course, self.setup.base_flow.gust
        gust_is_over = gust is not None and self.fluid.time >= gust.knots().max()
        if until == "out-of-pocket" and course.sinks and gust_is_over:
            return super().ends or IN_POCKET
        return super().ends or (until if until in course.done else "")

    # -- output -----------------------------------------------------------------------------------

    def columns(self, step: TimeStep) -> dict[str, Any]:
        contacts, gravity = self.contacts, np.array(self.scene.gravity_vector)
        slip = np.hypot(*contacts.velocities[:, 1:].T) if len(contacts) else np.zeros(1)
        load = contacts.mean_load(self.state.place, step.length)
        return {
            **super().columns(step),
            **columns_of_load(whole(load), self.scene.gdim, "contact", "contact_torque"),
            **named("weight", self.body.inertia.mass * gravity, self.scene.gdim),
            **named("buoyancy", -self.grain.volume * gravity, self.scene.gdim),
            "contacts": len(contacts),
            "slip": float(slip.max()),
            "mode": self.course.mode,
            **{f"work_{name}": work for name, work in zip(WORKS, self.course.works, strict=True)},
        }

    def contact_rows(self, step: TimeStep) -> list[dict[str, Any]]:
        contacts, gdim = self.contacts, self.scene.gdim
        forces, slips = contacts.forces(step.length), np.hypot(*contacts.velocities[:, 1:].T)
        return [
            {
                "time": step.time,
                "contact": number,
                **dict(zip("xyz", contacts.points[number].tolist(), strict=False)),
                **named("normal", contacts.normals[number], gdim),
                **named("force", forces[number], gdim),
                "slip": float(slips[number]),
            }
            for number in range(len(contacts))
        ]

    def reported(self) -> dict[str, Any]:
        trajectory, course = super().reported()["trajectory"], self.course
        length = self.last_step() or np.inf  # no impulses before the first step
        load = self.contacts.mean_load(self.state.place, length)
        force, torque = load[: self.scene.gdim], load[self.scene.gdim :]
        on_bed = {
            "mode": course.mode,
            "first_motion": course.first_motion,
            "first_step": course.first_step,
            "left_pocket": course.left,
            "works": dict(zip(WORKS, course.works, strict=True)),
            "force": force,
            "torque": torque if len(torque) == 3 else float(torque[0]),
        }
        return {"trajectory": {**trajectory, "on_bed": on_bed}}

    # -- checkpoints ------------------------------------------------------------------------------

    def stored(self, transient: Transient) -> dict[str, Any]:
        body = super().stored(transient)["body"]
        on_bed = {"course": asdict(self.course), "done": self.course.done}
        return {"body": {**body, "contacts": vars(self.contacts), "on_bed": on_bed}}

    def resume(self, kept: Checkpoint) -> None:
        super().resume(kept)
        self.course = Course(**kept.body["on_bed"]["course"])
        self.contacts = ActiveContacts(**kept.body["contacts"])
