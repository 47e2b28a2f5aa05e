"""Grain that rolls, slides and rests on its bed, and leaves its pocket."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ...arrays import SMALLEST
from ...coupled.coupling import Coupling
from ...coupled.rigid_on_bed import RigidPartOnBed
from ...fluid import Fluid
from ...fluid.transient import TimeStep, Transient
from ...geometry.placement import Placement
from ...results.loads import named
from ...setup.setup import Setup
from .bed_contact import BedContact
from .part import MovingGrain, columns_of_load

if TYPE_CHECKING:
    from ...restart import Checkpoint

# Largest advance, in gaps, of a new mesh ahead of a grain on its bed, by dimension: beyond, cells fold on the way back,
# in 3-D at 1.2 on cells 2.2 times as large (demos/scenes/sphere_leaving_pocket.toml).
AHEAD = {2: 3.0, 3: 0.3}
IN_POCKET = "in-pocket"  # returning or at rest after a gust


class GrainOnBed(MovingGrain):
    """Moving grain in contact with its bed; `bed_contact` has its history."""

    part: RigidPartOnBed

    def __init__(self, setup: Setup, *others: Any):
        super().__init__(setup, *others)
        scene, geometry, around = self.scene, setup.geometry, self.surroundings
        first = geometry.stance.placement
        assert scene.contact is not None and first is not None
        self.bed_contact = BedContact(
            *(geometry.near_bed, scene.contact_gap, self.body, scene.contact),
            *(scene.reference_velocity, first, self._weight()),
        )
        sides = tuple(side for side in around.sides if side.name != around.name_of_bed)
        self.obstacles = replace(around, sides=sides, near_bed=None)

    def _kind(self, *others: Any, **named: Any) -> RigidPartOnBed:
        return RigidPartOnBed(*others, contact=self.bed_contact.motion, **named)

    def _meshed_at(self) -> Placement:
        """Placement for a mesh: near contact up to half the next step ahead, with less shear of cells in the gap."""
        now, length, gap = self.state, self.last_step(), self.setup.scene.contact_gap
        if length is None or not len(self.bed_contact.motion.near(now.placement, gap)):
            return now.placement
        end = self.part.predicted(length, 2)
        way, turn = end.place - now.place, end.placement.turn_since(now.placement)
        longest = float(
            np.linalg.norm(way) + 0.5 * self.grain.size * np.linalg.norm(turn) * self.turns_mesh
        )
        share = min(0.5, AHEAD[self.body.gdim] * gap / max(longest, SMALLEST))
        return now.placement.moved(share * way, share * turn)

    # -- the run ----------------------------------------------------------------------------------

    def joined(self, fluid: Fluid, before: MovingGrain | None = None) -> None:
        super().joined(fluid, before)
        if isinstance(before, GrainOnBed):
            self.bed_contact = before.bed_contact

    def accept_step(self, step: TimeStep) -> None:
        super().accept_step(step)
        mean, (after, before, *_) = self.part.mean_load.previous, self.part.past
        assert mean is not None
        weight = np.concatenate([self._weight(), np.zeros(self.body.size - self.body.gdim)])
        self.bed_contact.accept((before, after), mean, weight, self.part.contacts)

    @property
    def does(self) -> str:  # type: ignore[override]
        """Motion in the last step: a mode, "flight" or "rest"."""
        return self.bed_contact.course.mode

    @property
    def ends(self) -> str:
        """Event that ends the run, as in `time.until`, "contact" or IN_POCKET; or ""."""
        until, course = self.time.until, self.bed_contact.course
        if until == "out-of-pocket" and course.sinks and self._gust_is_over():
            return super().ends or IN_POCKET
        return super().ends or (until if until in course.done else "")

    def _gust_is_over(self) -> bool:
        gust = self.setup.base_flow.gust
        return gust is not None and self._fluid.time >= gust.knots().max()

    # -- output -----------------------------------------------------------------------------------

    def _columns_at_contact(self, length: float) -> dict[str, Any]:
        contacts, gravity = self.part.contacts, np.array(self.scene.gravity_vector)
        return {
            **columns_of_load(
                contacts.mean_load(self.state.place, length), "contact", "contact_torque"
            ),
            **named("weight", self.body.inertia.mass * gravity, self.scene.gdim),
            **named("buoyancy", -self.grain.volume * gravity, self.scene.gdim),
            **self.bed_contact.columns(contacts),
        }

    def contact_rows(self) -> list[dict[str, Any]]:
        contacts, length, gdim = self.part.contacts, self.last_step(), self.scene.gdim
        if length is None:
            return []
        forces, slips = contacts.forces(length), np.hypot(*contacts.velocities[:, 1:].T)
        return [
            {
                "time": self._fluid.time,
                "contact": number,
                **dict(zip("xyz", contacts.points[number].tolist(), strict=False)),
                **named("normal", contacts.normals[number], gdim),
                **named("force", forces[number], gdim),
                "slip": float(slips[number]),
            }
            for number in range(len(contacts))
        ]

    def reported(self) -> dict[str, Any]:
        trajectory, length = super().reported()["trajectory"], self.last_step()
        load = (
            np.zeros(self.body.size)
            if length is None
            else self.part.contacts.mean_load(self.state.place, length)
        )
        force, torque = load[: self.scene.gdim], load[self.scene.gdim :]
        on_bed = {"force": force, "torque": torque if len(torque) == 3 else float(torque[0])}
        return {"trajectory": {**trajectory, "on_bed": {**self.bed_contact.reported(), **on_bed}}}

    def stored(self, coupling: Coupling | None, transient: Transient) -> dict[str, Any]:
        body = super().stored(coupling, transient)["body"]
        return {"body": replace(body, on_bed=self.bed_contact.stored(self.part.contacts))}

    def restore(self, kept: Checkpoint, coupling: Coupling | None) -> None:
        super().restore(kept, coupling)
        if kept.body is not None and kept.body.on_bed is not None:
            self.part.contacts = self.bed_contact.restore(kept.body.on_bed)
