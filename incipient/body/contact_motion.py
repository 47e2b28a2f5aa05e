"""A rigid body in contact over a time step: it rolls, slides or lifts off.

Impulses at the contacts are added to the load of `rigidbody.RigidBody` (Moreau 1988; Jean 1999). They obey Signorini's
and Coulomb's laws with the velocities at the end of the step, and act on the mass with the fluid's added mass. Contacts
are those at which the body would penetrate the bed in the step, whose length is kept, and with cohesion those of the
last step. An impulse acts along the mean of a contact's normals at both ends: rolling along a curved bed conserves
energy. Remaining gaps and overlaps are corrected in the position, not in the velocities.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ..arrays import Booleans, Floats, Integers, spatial
from ..contact.impulses import contact_impulses, resisted_impulses
from ..contact.problem import contact_frames
from ..geometry.contacts import ClosestPoints, shares, wrenches
from ..geometry.placement import Placement, rotation_of
from .rigidbody import Motion, RigidBody
from .state import BodyState

NearBed = Callable[[Placement, float], ClosestPoints]

SEEN = 0.05  # gap, relative to the reach, within which the next round searches for the contacts of the last


@dataclass(frozen=True)
class ContactLaw:
    """The law of contact between a body and its bed.

    friction: Coulomb's coefficient of contacts that stick; kinetic: of those that slide, None: the same
    restitution: fraction of the normal velocity with which the body leaves an impact (Newton's law), less where it
        would gain energy
    rolling: largest torque against rolling, over the normal force times half of the body's largest extent
    cohesion: largest tension of a contact closed before the step [force], which friction and rolling count as
        pressure; contacts in one plane share it
    """

    friction: float
    kinetic: float | None = None
    restitution: float = 0.0
    rolling: float = 0.0
    cohesion: float = 0.0


@dataclass(frozen=True, eq=False)
class ActiveContacts:
    """Contacts at the end of a step.

    points, normals: on the body, and from the bed to it, (k, gdim)
    impulses, velocities: over the step on the body, and of the body at the end, (k, 3): along the rows of `frames`
    rolling: impulses of torques that resist rolling, (k, 2), about the last two rows of `frames`
    work: of friction with resistance to rolling, and of pressure (at impacts) over the step
    returned: work of the load in addition to that along the mean velocity, where the body leaves the bed and is back
        within the step
    """

    points: Floats
    normals: Floats
    impulses: Floats
    velocities: Floats
    rolling: Floats
    work: tuple[float, float] = (0.0, 0.0)
    returned: float = 0.0

    @classmethod
    def unloaded(cls, places: ClosestPoints) -> ActiveContacts:
        local, torques = np.zeros((len(places), 3)), np.zeros((len(places), 2))
        return cls(places.points, places.normals, local, local, torques)

    @classmethod
    def none(cls, gdim: int) -> ActiveContacts:
        empty = np.zeros((0, gdim))
        return cls.unloaded(ClosestPoints(empty[:, 0], empty, empty))

    def __len__(self) -> int:
        return len(self.points)

    def places(self) -> ClosestPoints:
        return ClosestPoints(np.zeros(len(self)), self.points, self.normals)

    def forces(self, length: float) -> Floats:
        mean = np.einsum("ki,kij->kj", self.impulses, frames(self.normals)) / length
        return np.asarray(mean[:, : self.points.shape[1]])

    def mean_load(self, place: Floats, length: float) -> Floats:
        """Mean force and torque about a point (3,), in 3-D (6,), over a step of a length."""
        local = np.concatenate([self.impulses, np.pad(self.rolling, ((0, 0), (1, 0)))])
        rows = momenta(self.points, frames(self.normals), place)
        return np.asarray(local.ravel() @ rows / length)


@dataclass(frozen=True, eq=False)
class ContactStep:
    """A step: its end outside the bed, the contacts there, and the motion before the correction.

    pushed: impulse of force and torque (n,) by all contacts
    """

    end: BodyState
    contacts: ActiveContacts
    motion: Motion
    pushed: Floats

    def created(self) -> float:
        """The work of contacts on the body over that of their impulses with its velocities."""
        fastest = np.abs([self.motion.start.velocities, self.motion.end.velocities]).max(axis=0)
        whole = float(np.abs(self.pushed) @ fastest)
        return sum(self.contacts.work) / whole if whole > 0.0 else 0.0


class ContactMotion:
    """A body, the bed near it, and the law of contact.

    near: gaps, points and normals at a placement, of all points within a distance of the bed, zero where contact begins
    reach: the body's largest extent
    """

    def __init__(self, body: RigidBody, near: NearBed, law: ContactLaw, reach: float):
        self.body, self.near, self.law, self.reach = body, near, law, reach
        self._lever = 0.5 * reach
        self._closed = 1e-9 * reach

    def step(
        self,
        state: BodyState,
        dt: float,
        load: Floats,
        added: Floats | None = None,
        guess: Floats | None = None,
        before: ActiveContacts | None = None,
        tried: ContactStep | None = None,
    ) -> ContactStep:
        """The motion over a step under a mean load (n,) as `RigidBody.motion`, after contacts `before`.

        `tried`, a similar step, is the initial guess. Raises ConvergenceError where the impulses do not converge.
        """

        def moved(pushed: Floats) -> Motion:
            return self.body.motion(state, dt, load + pushed / dt, added, guess)

        none = ActiveContacts.none(self.body.gdim)
        pushed = np.zeros(self.body.size) if tried is None else tried.pushed
        first = ContactStep(state, none if tried is None else tried.contacts, moved(pushed), pushed)
        gain, apart = (
            self.body.velocities_by_impulses(state, added),
            self._apart(state, first.motion.end, dt),
        )
        taken = self._taken(first, moved, before or none, gain, apart)
        # Of impulses times velocities, what contacts may do in work.
        if taken.created() > 1e-3:
            # Normals that turn abruptly, as at a corner: impulses along the mean of both would do work.
            other = self._taken(first, moved, before or none, gain, apart, along_mean=False)
            taken = min(taken, other, key=ContactStep.created)
        if self.law.restitution > 0.0 and self.body.gdim == 3:
            # The spin turns with the correction of the orientation, which keeps the energy.
            end, unturned = taken.end, rotation_of(taken.motion.end.orientation).inv()
            spin = (rotation_of(end.orientation) * unturned).apply(end.spin)
            taken = replace(taken, end=replace(end, spin=spin))
        return taken

    def _taken(
        self,
        first: ContactStep,
        moved: Callable[[Floats], Motion],
        before: ActiveContacts,
        gain: Floats,
        apart: float,
        along_mean: bool = True,
    ) -> ContactStep:
        """The step from an initial guess.

        gain: velocities (n, n) per unit impulse; apart: largest shift of a contact
        along_mean: whether impulses act along the mean of normals at both ends
        """
        motion, pushed = first.motion, first.pushed
        state, earlier = motion.start, before.places()
        # The largest impulse against the opening of a contact that lasts
        tension = self.law.cohesion * (motion.end.time - state.time)
        end, seen = motion.end, self._seen(motion.end)
        if len(first.contacts) == 0:
            touched = seen.only(seen.gaps < -self._closed)
        else:
            touched = first.contacts.places()
            end, seen = self._placed(end, seen, touched, gain, apart)
        if tension > 0.0:
            bonds = matches(earlier, seen, apart)
            touched = _together(touched, seen.only(bonds[bonds >= 0]), apart)
        for number in range(40):  # until neither impulses nor positions change
            if len(touched) == 0:
                return ContactStep(end, ActiveContacts.none(self.body.gdim), motion, pushed)
            rows = self._rows(touched.points, frames(touched.normals), end.place)
            # The contact of the last step that each one is; -1: none.
            lasting = matches(touched, earlier, apart)
            new = lasting < 0
            lasts = 1.0 - new
            tensions = tension * lasts * shares(touched.points, touched.normals, lasts)
            ways = self._ways(rows, touched, lasting, before, state.place) if along_mean else rows
            velocities = (
                state.velocities,
                motion.end.velocities - gain @ pushed,
                self._approach(motion),
            )
            local = self._impulses(rows, ways, velocities, gain, new, tensions)
            holds = local[: len(touched), 0] + tensions > 0.0
            pushed = ways.T @ local.ravel()
            motion = moved(pushed)
            last, entered = end, self._seen(motion.end)
            end, seen = self._placed(motion.end, entered, touched.only(holds), gain, apart)
            settled = float(np.abs(end.packed() - last.packed()).max()) <= 1e-9 * max(
                self.reach, 1.0
            )
            pressed = touched
            touched = self._next(touched, holds, seen, entered, apart)
            if len(touched) == 0:
                # Along a side that lies on the bed the nearest point may have moved: loaded contacts stay.
                touched = pressed.only(holds)
            # Contacts may alternate, such as the ends of a side that lands: from then on they are kept.
            if number >= 12:
                touched = _together(touched, pressed, apart)
            if settled and len(touched) == len(pressed):
                break
        # Where two ends of a step alternate, the last obeys the laws at contacts displaced by their difference.
        contacts = _contacts(pressed, local, (rows, ways), velocities, motion, self._lever, new)
        return ContactStep(end, contacts, motion, pushed)

    def closed(self, placement: Placement) -> ActiveContacts:
        """The contacts of a body at rest that cohesion closes from the first step on."""
        if self.law.cohesion == 0.0:
            return ActiveContacts.none(self.body.gdim)
        near = self.near(placement, SEEN * self.reach)
        return ActiveContacts.unloaded(near.only(np.abs(near.gaps) <= 1e-6 * self.reach))

    def kept_out(self, end: BodyState) -> BodyState:
        """A state moved out of the bed, with its velocities."""
        shapes = np.where(np.arange(self.body.size) < self.body.gdim, 1.0, self.reach**-2)
        seen, gain = self._seen(end), np.diag(np.where(self.body.mask, shapes, 0.0))
        return self._placed(end, seen, seen.only([]), gain, 0.0)[0]

    def _apart(self, state: BodyState, end: BodyState, dt: float) -> float:
        # A contact moves at most over the path of the body in the step, plus a fraction of the reach.
        ways = [
            np.linalg.norm(at.velocity) + self.reach * np.linalg.norm(at.spin)
            for at in (state, end)
        ]
        return float(2.0 * dt * max(ways)) + 1e-3 * self.reach

    def _seen(self, end: BodyState) -> ClosestPoints:
        return self.near(end.placement, SEEN * self.reach)

    def _rows(self, points: Floats, ways: Floats, place: Floats) -> Floats:
        """`momenta` (m, n): m = 3k without resistance to rolling, otherwise 6k, as `resisted_impulses` has them."""
        rows, count = momenta(points, ways, place), 3 * len(points)
        rows[count:] *= self._lever
        return rows[:count] if self.law.rolling == 0.0 else rows

    def _ways(
        self,
        rows: Floats,
        touched: ClosestPoints,
        lasting: Integers,
        before: ActiveContacts,
        place: Floats,
    ) -> Floats:
        """Mean of rows at both ends of the step from a place, for contacts that are `lasting` ones `before` it."""
        lasts = lasting >= 0
        if not lasts.any():
            return rows
        normals = np.where(lasts[:, None], before.normals[lasting], touched.normals)
        ways = _transported(frames(touched.normals), normals)
        first = self._rows(before.points[lasting], ways, place)
        both = np.resize(np.repeat(lasts, 3), len(rows))
        return np.where(both[:, None], 0.5 * (rows + first), rows)

    def _impulses(
        self,
        rows: Floats,
        ways: Floats,
        velocities: tuple[Floats, Floats, Floats],
        gain: Floats,
        new: Booleans,
        tensions: Floats,
    ) -> Floats:
        """Impulses (k, 3), and with resistance to rolling torques, at contacts of which some are `new`.

        velocities: of the body at the start, at the end without contact, and before an impact
        Where impacts with the law's restitution would do work, at a contact that leaves the bed and that others press
        onto it, or by friction (Kane and Levinson 1985), all have the largest restitution without such work.
        """
        by_impulses = rows @ gain @ ways.T

        def with_restitution(coefficient: float) -> tuple[Floats, bool]:
            """Impulses, and whether they do work with the mean of the velocities before and after the impact."""
            local = self._bounced(rows, velocities, by_impulses, coefficient * new, tensions)
            pushed, before = ways.T @ local.ravel(), velocities[2]
            work = pushed @ (before + velocities[1] + gain @ pushed)
            return local, bool(work > 1e-9 * np.abs(local.ravel()) @ np.abs(ways @ before))

        least, most = 0.0, self.law.restitution
        local, does_work = with_restitution(most)
        approaches = (rows @ velocities[2])[: 3 * len(new) : 3] < 0.0
        if most == 0.0 or not does_work or not (new & approaches).any():
            return local
        local, does_work = with_restitution(least)
        while most - least > 1e-12 and not does_work:
            middle = 0.5 * (least + most)
            between, gains = with_restitution(middle)
            if gains:
                most = middle
            else:
                least, local = middle, between
        return local

    def _bounced(
        self,
        rows: Floats,
        velocities: tuple[Floats, Floats, Floats],
        gain: Floats,
        restitution: Floats,
        tensions: Floats,
    ) -> Floats:
        """Impulses as `_impulses`, for restitution by contact (k,) and velocities by impulses `gain`."""
        count = len(restitution)
        first, free, approach = ((rows @ of_body).reshape(-1, 3) for of_body in velocities)
        largest = float(np.abs([first[:count], free[:count]]).max())
        slides = np.hypot(*first[:count, 1:].T) > 1e-9 * largest
        free[:count, 0] += restitution * np.minimum(approach[:count, 0], 0.0)
        # Impulses with the tensions added obey the laws without cohesion.
        without = free.ravel() - gain[:, : 3 * count : 3] @ tensions
        local = self._obeying(gain, without, slides)
        if self.law.kinetic is not None:
            # A contact that static friction does not hold slides from the start of the step.
            last = (without + gain @ local.ravel()).reshape(-1, 3)[:count]
            slides |= np.hypot(*last[:, 1:].T) > 1e-9 * largest
            local = self._obeying(gain, without, slides)
        local[:count, 0] -= tensions
        return local

    def _approach(self, motion: Motion) -> Floats:
        """Velocities (n,) before an impact whose mean with those after it is the mean over the step.

        An impulse does work with the latter: in 3-D velocities change unevenly as a body turns. At the start in 2-D.
        """
        start, end = motion.start.velocities, motion.end.velocities
        if self.law.restitution == 0.0 or self.body.gdim == 2:
            return start
        time = 0.5 * (motion.start.time + motion.end.time)
        middle = self.body.driven(motion.start, time, motion.drive).velocities
        return (start + 4.0 * middle + end) / 3.0 - end  # by Simpson's rule

    def _obeying(self, gain: Floats, free: Floats, slides: Booleans) -> Floats:
        law = self.law
        friction = np.where(
            slides, law.friction if law.kinetic is None else law.kinetic, law.friction
        )
        if law.rolling == 0.0:
            return contact_impulses(gain, free, friction)
        return resisted_impulses(gain, free, friction, law.rolling)

    def _placed(
        self,
        end: BodyState,
        seen: ClosestPoints,
        pressing: ClosestPoints,
        gain: Floats,
        apart: float,
    ) -> tuple[BodyState, ClosestPoints]:
        d = self.body.gdim
        for _ in range(8):  # by gaps that are taken for linear in the position
            last = matches(pressing, seen, apart)
            held = np.union1d(last[last >= 0], np.flatnonzero(seen.gaps < -self._closed))
            gaps, near = seen.gaps[held], seen.only(held)
            if len(held) == 0 or np.abs(gaps).max() <= self._closed:
                return end, seen
            normal = momenta(near.points, frames(near.normals), end.place)[: 3 * len(near) : 3]
            way = gain @ normal.T @ np.linalg.lstsq(normal @ gain @ normal.T, -gaps, rcond=1e-10)[0]
            end = BodyState.at(end.placement.moved(way[:d], way[d:]), end.velocities, end.time)
            seen = self._seen(end)
        return end, seen

    def _next(
        self,
        touched: ClosestPoints,
        holds: Booleans,
        seen: ClosestPoints,
        entered: ClosestPoints,
        apart: float,
    ) -> ClosestPoints:
        """Contacts that press or stay closed, and those that entered the bed, also before the correction."""
        now = matches(touched, seen, apart)
        deep = matches(entered.only(entered.gaps < -self._closed), seen, apart)
        closed = np.append(seen.gaps, np.inf)[now] <= self._closed
        still = np.union1d(now[(now >= 0) & (holds | closed)], deep[deep >= 0])
        return seen.only(np.union1d(still, np.flatnonzero(seen.gaps < -self._closed)))


def _contacts(
    touched: ClosestPoints,
    local: Floats,
    ways: tuple[Floats, Floats],
    earlier: tuple[Floats, Floats, Floats],
    motion: Motion,
    lever: float,
    new: Booleans,
) -> ActiveContacts:
    (rows, along), (start, _, before), count = ways, earlier, len(touched)
    mean = (along @ (0.5 * (before + motion.end.velocities))).reshape(-1, 3)
    velocities = (rows[: 3 * count] @ motion.end.velocities).reshape(-1, 3)
    # The bed presses only once a body that was leaving it is back, so not along the way out.
    leaving = np.maximum((along[: 3 * count : 3] @ start), 0.0) * new
    returned = float(0.5 * local[:count, 0] @ leaving)
    pressure = float(local[:count, 0] @ mean[:count, 0]) - returned
    works = float((local[:, 1:] * mean[:, 1:]).sum()), pressure
    torques = lever * local[count:, 1:] if len(local) > count else np.zeros((count, 2))
    return ActiveContacts(
        touched.points, touched.normals, local[:count], velocities, torques, works, returned
    )


def frames(normals: Floats) -> Floats:
    """Rows (k, 3, 3): the normals (k, gdim) and two directions along the surface, in 2-D along it and across."""
    return contact_frames(spatial(normals), None if normals.shape[1] == 3 else np.eye(3)[2])


def momenta(points: Floats, ways: Floats, place: Floats) -> Floats:
    """Momentum (6k, n) about a point (gdim,) of unit impulses along ways (k, 3, 3) at points (k, gdim), then of unit
    torques: none, and about the last two ways.
    """
    d, arms = len(place), np.repeat(points - place, 3, axis=0)
    pushed = wrenches(ways.reshape(-1, 3)[:, :d], arms, 1.0)
    turned = np.zeros((*ways.shape[:2], pushed.shape[1]))
    turned[:, 1:, d:] = ways[:, 1:, 2:] if d == 2 else ways[:, 1:]
    return np.concatenate([pushed, turned.reshape(pushed.shape)])


def _together(touched: ClosestPoints, others: ClosestPoints, apart: float) -> ClosestPoints:
    missing = others.only(matches(others, touched, apart) < 0)
    names = ("gaps", "points", "normals")
    return ClosestPoints(
        *(np.concatenate([getattr(touched, name), getattr(missing, name)]) for name in names)
    )


def _transported(ways: Floats, normals: Floats) -> Floats:
    """Frames (k, 3, 3), turned as little as possible to other normals (k, gdim)."""
    first = spatial(normals)[:, None]
    along = ways[:, 1:] - (ways[:, 1:] @ first.transpose(0, 2, 1)) * first
    return np.concatenate([first, along / np.linalg.norm(along, axis=2, keepdims=True)], axis=1)


def matches(touched: ClosestPoints, others: ClosestPoints, apart: float) -> Integers:
    """Which of `others` (k,) each contact is: the nearest with about its normal; -1: none."""
    if not len(others):
        return np.full(len(touched), -1)
    away = np.linalg.norm(touched.points[:, None] - others.points, axis=2)
    away[touched.normals @ others.normals.T < 0.9] = np.inf  # cosine of the normals of one contact
    return np.where(away.min(axis=1) <= apart, away.argmin(axis=1), -1)
