"""A grain on its bed: its contacts, and settling until it rests in static equilibrium under gravity.

Each quasi-static step moves the grain along the part of gravity that the contacts cannot balance, without penetration,
and is shortened until it lowers the centre. Near an equilibrium Newton's method closes the contacts and removes the
torque.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from incipient.arrays import Floats, cross, planar_cross, quarter_turned, spatial
from incipient.errors import SceneError, refuse_broken
from incipient.geometry.contacts import (
    ClosestPoints,
    Contacts,
    Hold,
    hold,
    nearest_motion,
    shares,
    tangents,
    wrenches,
)
from incipient.geometry.placement import Placement
from incipient.geometry.plane.beds import Bed
from incipient.geometry.plane.closest import PlanarProximity
from incipient.geometry.plane.grains import Grain
from incipient.geometry.proximity import SAME_PLACE, Proximity
from incipient.geometry.space.beds import Terrain
from incipient.geometry.space.closest import SpatialProximity
from incipient.geometry.space.grains import Solid

# In grain sizes.
FIRST_STEP, LONGEST_STEP, SHORTEST_STEP = 0.05, 0.4, 1e-9
TOUCHING = 1e-6  # what counts as touching on the way
CLOSED = 1e-10  # gaps of contacts at rest
BALANCED = 1e-9  # unbalanced force and torque at rest, of weight and weight times size
ROLLS = 60
PROMISING = 0.05  # pull, in weights, from which on Newton's method is tried
USED = 1e-9  # fraction of the weight from which on a contact takes part in carrying it


def proximity(grain: Grain | Solid, bed: Bed | Terrain) -> Proximity:
    """A grain and a bed for queries at many placements. Raises SceneError if only one is planar."""
    if isinstance(grain, Solid) and isinstance(bed, Terrain):
        return SpatialProximity(grain, bed)
    if isinstance(grain, Grain) and isinstance(bed, Bed):
        return PlanarProximity(grain, bed)
    raise SceneError(
        f"a {type(grain).__name__} cannot rest on a bed {type(bed).__name__}: one is planar, the other is not; "
        "take both in 2-D or both in 3-D"
    )


def touching(
    grain: Grain | Solid, placement: Placement, bed: Bed | Terrain, tolerance: float
) -> Contacts:
    """All contacts of a grain whose distance from the bed is at most `tolerance` (a length).

    Point contacts are local minima of the distance. A straight side on a straight piece of bed is a patch: its two
    ends, each with half of its length as area; in 3-D the corners of the patch's convex hull, with areas of the same
    sum and centroid. `areas` is None without a patch. The normal is the grain's where its surface is smooth, minus the
    bed's at a corner of the grain, and at a corner of the bed the bisector; a valley's corner has a contact for each
    side.

    Raises SceneError if nothing touches, or if only one of grain and bed is planar.
    """
    if not tolerance > 0.0:
        raise SceneError(
            f"contact tolerance {tolerance} is not a positive length; give a positive number"
        )
    return proximity(grain, bed).contacts(placement, tolerance)


def touching_under(
    near_bed: Proximity, placement: Placement, force: Floats, tolerance: float
) -> Contacts:
    """Contacts; a single one is on the line of action of a force (gdim,) at the centroid, if it may be there.

    Where a grain is nearly flat, the position of a contact is far less accurate than its normal.
    """
    load = np.append(force, np.zeros(2 * placement.gdim - 3))
    return _Descent(near_bed, load, np.inf).contacts(placement, tolerance)


class SettlingOutcome(Enum):
    """Outcome of settling."""

    RESTS = "rests in equilibrium"
    BALANCES = "balances: the least disturbance makes it fall"
    ROLLS_OFF = "rolls off: it leaves the bed, or its surroundings, before it finds a rest"
    UNSETTLED = "did not come to rest in the steps allowed"


@dataclass(frozen=True, eq=False)
class Settled:
    """The rest of a grain, or why the grain has none."""

    placement: Placement  # the last one; the grain touches the bed there
    contacts: Contacts | None  # where it touches the bed, None unless it rests or balances
    outcome: SettlingOutcome  # how settling ended; `stable` is true if the grain rests

    @property
    def stable(self) -> bool:
        """Whether the equilibrium is stable, or neutral, under small disturbances."""
        return self.outcome is SettlingOutcome.RESTS


def settle(
    grain: Grain | Solid,
    bed: Bed | Terrain,
    start: Placement,
    gravity: Sequence[float] | Floats | None = None,
    friction: float = 1.0,
    reach: float = 10.0,
    max_steps: int = 2000,
    torque: Floats | float = 0.0,
    cohesion: float = 0.0,
) -> Settled:
    """Lower the grain from `start` onto the bed and let it roll and tip until it rests.

    `gravity` (gdim,) is a dead load at the centroid, by default downwards, and `torque` the one about it, (1,) or in
    3-D (3,); only their ratio and that to `cohesion`, the largest pull of a contact, matter. An open contact does not
    pull, and to tear it takes no energy. With Coulomb friction the grain stays where contacts first support it; with 0
    it slides to a minimum of its potential energy, with infinity contacts do not slip. A grain that leaves the bed, or
    moves farther than `reach` grain sizes, rolls off.

    Raises SceneError if grain and bed differ in dimension, or gravity or friction is invalid.
    """
    down = [0.0] * (grain.gdim - 1) + [-1.0]
    force = np.array(down if gravity is None else gravity, dtype=float)
    weight = float(np.linalg.norm(force))
    refuse_broken(
        (
            force.shape != (grain.gdim,) or not 0.0 < weight < np.inf,
            f"gravity {force.tolist()} has no direction; give {grain.gdim} numbers, not all zero",
        ),
        (
            not friction >= 0.0,
            f"friction {friction} is not a coefficient; give a number that is not negative",
        ),
        (
            start.gdim != grain.gdim,
            f"a placement in {start.gdim} dimensions does not fit a grain in {grain.gdim}; "
            f"give one in {grain.gdim}",
        ),
    )
    turn = np.broadcast_to(torque, 2 * grain.gdim - 3) / grain.size
    load = np.append(force, turn) / weight
    descent = _Descent(proximity(grain, bed), load, float(friction), cohesion / weight)
    return descent.run(start, reach * grain.size, max_steps)


@dataclass(frozen=True, eq=False)
class _Rest:
    """An equilibrium, its loaded contacts, and the free motion of its instability (stable: None)."""

    placement: Placement
    carrying: ClosestPoints
    way_down: Floats | None


@dataclass(frozen=True, eq=False)
class _Descent:
    proximity: Proximity
    load: Floats  # of unit force, with the torque about the centre over the size
    friction: float
    cohesion: float = 0.0

    @property
    def size(self) -> float:
        return self.proximity.size

    def run(self, start: Placement, reach: float, max_steps: int) -> Settled:
        placement, attempted = self.proximity.lowered(start), None
        length, tried = FIRST_STEP, np.inf
        for step in range(max_steps):
            near = self.proximity.minima(placement, 2.5 * length * self.size)
            touching = self._touching(placement, near, TOUCHING)
            held = self._hold(placement, touching)
            strength = float(np.linalg.norm(held.remainder))
            # An attempt costs some steps: it is made when the pull has halved, or when there is no other way;
            # not again at a placement, nor next to an unstable equilibrium that the grain is leaving.
            tried = np.inf if strength >= PROMISING else tried
            promising = strength < min(PROMISING, 0.5 * tried) or length < SHORTEST_STEP
            if promising and placement is not attempted:
                rest = self._at_rest(placement, near)
                tried, attempted = strength, placement
                if rest is not None:
                    if rest.way_down is None or (step == 0 and strength <= BALANCED):
                        return self._settled(rest)
                    pushed = self._pushed(rest, rest.way_down)
                    if self._work(placement, pushed) > 0.0:
                        placement, length, tried = pushed, FIRST_STEP, 0.0
                        continue
            if length < SHORTEST_STEP:
                break
            ahead = self.proximity.locally_least(placement, near, corners=True)
            motion = self._step(placement, ahead, held, length)
            trial = self.proximity.lowered(self._followed(placement, ahead, motion))
            gain, expected = self._work(placement, trial), self.size * float(motion @ self.load)
            if gain > max(0.1 * expected, 0.0):
                placement = trial
                length = min(1.5 * length, LONGEST_STEP) if gain > 0.5 * expected else length
            else:
                length = 0.3 * length
            if self._left(placement, start, reach):
                return Settled(placement, None, SettlingOutcome.ROLLS_OFF)
        return Settled(placement, None, SettlingOutcome.UNSETTLED)

    def _motion(self, before: Placement, after: Placement) -> Floats:
        shift = np.asarray(after.centre) - np.asarray(before.centre)
        return np.append(shift / self.size, after.turn_since(before))

    def _work(self, before: Placement, after: Placement) -> float:
        return self.size * float(self.load @ self._motion(before, after))

    def _left(self, placement: Placement, start: Placement, reach: float) -> bool:
        low, high = np.transpose(self.proximity.bed.extent)
        x, x0 = np.array(placement.centre[:-1]), np.array(start.centre[:-1])
        beyond = (x < low) | (x > high)
        apart = (
            np.linalg.norm(x - x0),
            0.25 * self.size * np.linalg.norm(placement.turn_since(start)),
        )
        return bool(beyond.any() or max(apart) > reach)

    def _touching(
        self, placement: Placement, near: ClosestPoints, tolerance: float
    ) -> ClosestPoints:
        close = near.only(near.gaps <= tolerance * self.size)
        return self.proximity.locally_least(placement, close, slack=tolerance * self.size)

    def _arms(self, placement: Placement, near: ClosestPoints) -> Floats:
        return np.asarray(near.points - np.asarray(placement.centre))

    def _hold(self, placement: Placement, near: ClosestPoints) -> Hold:
        arms = self._arms(placement, near)
        return hold(self._pulled(arms, near), near.normals, arms, self.friction, self.size)

    def _pulled(self, arms: Floats, near: ClosestPoints) -> Floats:
        """The load with the largest pulls of contacts, which the forces within friction cones have to balance."""
        if self.cohesion == 0.0 or not len(near):
            return self.load
        pulls = self.cohesion * shares(near.points, near.normals)[:, None] * near.normals
        return np.asarray(self.load - wrenches(pulls, arms, self.size).sum(axis=0))

    def _step(self, placement: Placement, near: ClosestPoints, held: Hold, length: float) -> Floats:
        closing = self.proximity.rates(placement, near)
        gaps = np.maximum(near.gaps, 0.0) / self.size
        strength = max(float(np.linalg.norm(held.remainder)), 1e-6)
        if self.friction == 0.0:
            # The load with the pulls of contacts.
            load = held.remainder - held.factors @ held.rows if self.cohesion else self.load
            motion = length * nearest_motion(closing, -gaps / length, load / strength)
            return motion / max(1.0, 0.5 * float(np.linalg.norm(motion)) / length)
        # With friction the motion ends where a contact is made, because that will hold the grain.
        motion = length * held.remainder / strength
        approach = -(closing @ motion)
        meets = (gaps > TOUCHING) & (approach > 0.0)
        return motion * min(1.0, float((gaps[meets] / approach[meets]).min(initial=1.0)))

    def _followed(self, placement: Placement, near: ClosestPoints, motion: Floats) -> Placement:
        after = near.gaps / self.size + self.proximity.rates(placement, near) @ motion
        kept = near.only(after <= 1e-6 * float(np.linalg.norm(motion)))
        moved = self.proximity.moved(placement, motion)
        # Lowering the grain closes a single one.
        closed = self.proximity.closed(moved, kept) if len(kept) > 1 else moved
        # Contacts that slide along whole facets cannot be kept: closing them leads anywhere.
        astray = np.linalg.norm(self._motion(moved, closed)) > np.linalg.norm(motion)
        return moved if astray else closed

    def _carrying(self, placement: Placement, touching: ClosestPoints) -> ClosestPoints:
        held = self._hold(placement, touching)
        used = np.unique(held.owner[held.factors > USED])
        return touching if self.cohesion else touching.only(used)

    def _constraints(self, placement: Placement, carrying: ClosestPoints) -> Floats:
        held = self._hold(placement, carrying)
        used = held.rows[held.factors > USED]
        if self.friction == 0.0 or (np.isfinite(self.friction) and len(used) <= len(carrying)):
            return used
        return np.vstack(
            [self.proximity.rates(placement, carrying), *self._along(placement, carrying)]
        )

    def _along(self, placement: Placement, carrying: ClosestPoints) -> list[Floats]:
        arms = self._arms(placement, carrying)
        return [wrenches(tangent, arms, self.size) for tangent in tangents(carrying.normals)]

    def _at_rest(self, placement: Placement, near: ClosestPoints) -> _Rest | None:
        """The equilibrium next to a placement, first with all points that nearly touch, then with local minima."""
        close = near.only(near.gaps <= 10.0 * TOUCHING * self.size)
        close = close.distinct(SAME_PLACE * self.size)
        least = self.proximity.locally_least(placement, close)
        for contacts in (close, least) if len(least) < len(close) else (close,):
            carrying = self._carrying(placement, contacts)
            result = self._newton(placement, carrying) if len(carrying) else None
            rest = None if result is None else self._verified(result, placement)
            if rest is not None:
                return rest
        return self._verified(self._rolled(placement), placement)

    def _verified(self, result: Placement, before: Placement) -> _Rest | None:
        result = self.proximity.lowered(result)
        if self._work(result, before) > TOUCHING * self.size:
            return None
        near = self.proximity.minima(result, 0.01 * self.size)
        touching = self._touching(result, near, CLOSED)
        carrying = self._beneath(result, self._carrying(result, touching))
        if np.abs(self._hold(result, carrying).remainder).max() > BALANCED:
            return None
        return _Rest(result, carrying, self._way_down(result, carrying))

    def _rolled(self, placement: Placement) -> Placement:
        """Turn the grain until a single contact balances the load.

        The angle is a smooth function of the contact's position, whose inverse defeats Newton's method without
        curvature.
        """
        last = np.inf
        for _ in range(ROLLS):
            near = self.proximity.minima(placement, TOUCHING * self.size)
            touching = self._touching(placement, near, TOUCHING)
            if len(touching) != 1:
                break
            shift = self._shift(placement, touching)
            ends = placement.to_body(np.vstack([touching.points, touching.points + shift]))
            here, there = self.proximity.grain.normal(ends) @ placement.rotation.T
            turn = cross(there, here) if len(here) == 3 else planar_cross(there, here)
            # Where a surface is flat the contact's position is round-off: the turn alone tells progress.
            angle = float(np.linalg.norm(turn))
            if not CLOSED < angle < 0.99 * last:
                break
            last = angle
            placement = self.proximity.lowered(placement.moved(0.0 * here, turn))
        return placement

    def _shift(self, placement: Placement, contacts: ClosestPoints) -> Floats:
        force, arms = self.load[: self.proximity.grain.gdim], self._arms(placement, contacts)
        forces = np.tile(force, (len(arms), 1))
        torque = self.size * (self.load - wrenches(forces, arms, self.size))[:, len(force) :]
        return cross(forces, torque) if len(force) == 3 else -torque * quarter_turned(forces)

    def _beneath(self, placement: Placement, carrying: ClosestPoints) -> ClosestPoints:
        """Move a single contact onto the line of action of the load if the surfaces still face each other there.

        Where relative curvature is small, a contact's position is far less accurate than its normal.
        """
        moved = carrying
        for _ in range(ROLLS if len(carrying) == 1 else 0):  # on a slope the shift is not exact
            if np.abs(self._hold(placement, moved).remainder).max() <= BALANCED:
                break
            points = self.proximity.bed.nearest(moved.points + self._shift(placement, moved))
            moved = replace(moved, points=points, anchors=placement.to_body(points))
        if moved is carrying:
            return carrying
        outward = self.proximity.grain.normal(moved.anchors) @ placement.rotation.T
        place = moved.points[:, 0] if self.proximity.grain.gdim == 2 else moved.points[:, :2]
        # Normals of superellipses are accurate to 4e-9.
        opposite = np.abs(outward + self.proximity.bed.normal(place)).max() <= 10.0 * BALANCED
        # The line of action may meet the bed beyond the grain, as in a hollow below it.
        apart = np.abs(self.proximity.grain.level(moved.anchors)).max()
        return moved if opposite and apart <= TOUCHING * self.size else carrying

    def _newton(self, placement: Placement, carrying: ClosestPoints) -> Placement | None:
        last = np.inf
        for _ in range(12):  # which double the correct digits each time
            error = self._error(placement, carrying)
            size = float(np.abs(error).max())
            if size < 1e-15 or 0.1 * last < size < BALANCED:
                return placement
            motion = self._correction(placement, carrying, error)
            if size > 2.0 * min(last, PROMISING) or np.linalg.norm(motion) > LONGEST_STEP:
                return None
            last = size
            placement = self.proximity.moved(placement, motion)
            carrying = self.proximity.tracked(placement, carrying)
        return None

    def _correction(self, placement: Placement, carrying: ClosestPoints, error: Floats) -> Floats:
        """The Newton update; with friction, of all equivalent ones that of least slip."""
        left, values, right = np.linalg.svd(
            self._derivative(placement, carrying), full_matrices=True
        )
        # Away from equilibrium free directions also have small values, in proportion to the error.
        small = float(np.clip(np.abs(error).max(), 1e-6, 1e-2))
        rank = int((values > small * max(values[0], 1e-300)).sum())
        motion = -right[:rank].T @ ((left[:, :rank].T @ error) / values[:rank])
        if self.friction > 0.0 and rank < len(motion):
            slips = np.vstack(self._along(placement, carrying))
            free = right[rank:].T
            motion -= free @ np.linalg.lstsq(slips @ free, slips @ motion, rcond=1e-6)[0]
        return np.asarray(motion)

    def _error(self, placement: Placement, carrying: ClosestPoints) -> Floats:
        moved = self.proximity.tracked(placement, carrying)
        rows = self._constraints(placement, moved)
        load = self._pulled(self._arms(placement, moved), moved)
        factors = np.linalg.lstsq(rows.T, load, rcond=1e-9)[0]
        return np.concatenate([moved.gaps / self.size, load - factors @ rows])

    def _derivative(self, placement: Placement, carrying: ClosestPoints) -> Floats:
        h, columns = 1e-6, []
        for motion in h * np.eye(len(self.load)):
            ahead, behind = (
                self._error(self.proximity.moved(placement, s * motion), carrying)
                for s in (1.0, -1.0)
            )
            columns.append((ahead - behind) / (2.0 * h))
        return np.column_stack(columns)

    def _way_down(self, placement: Placement, carrying: ClosestPoints) -> Floats | None:
        from scipy.linalg import null_space  # which takes time to import

        free = null_space(self._constraints(placement, carrying), rcond=1e-7).T
        if len(free) == 0:
            return None
        # Changes of the load with motions, in grain sizes. A grain that rolls need not have a potential: a spin on a
        # single contact changes the torque that rolls it, but rolling makes no torque that spins it.
        stiffness = -free @ self._derivative(placement, carrying)[len(carrying) :] @ free.T
        values, vectors = np.linalg.eig(stiffness)
        least = int(np.argmin(values.real))
        direction = np.asarray(vectors[:, least].real @ free)
        if values[least].real > -1e-4:  # which counts as level
            return None
        # Disturbed by 1e-3 one way or the other it must get lower without being in the way of the bed.
        ends = self._disturbed(placement, carrying, direction, (1e-3,))
        falls = any(self._work(placement, end) > 1e-11 * self.size for end in ends)
        return direction if falls else None

    def _pushed(self, rest: _Rest, way_down: Floats) -> Placement:
        pushes = (0.003, 0.01, 0.03, 0.1)  # grain sizes
        ends = self._disturbed(rest.placement, rest.carrying, way_down, pushes)
        return max(ends, key=lambda end: self._work(rest.placement, end))

    def _disturbed(
        self,
        placement: Placement,
        carrying: ClosestPoints,
        direction: Floats,
        lengths: Sequence[float],
    ) -> Iterator[Placement]:
        """Placements one way and the other, with the contacts kept and the grain lowered."""
        for length in lengths:
            for motion in (length * direction, -length * direction):
                moved = self.proximity.moved(placement, motion)
                yield self.proximity.lowered(self.proximity.closed(moved, carrying))

    def contacts(self, placement: Placement, tolerance: float) -> Contacts:
        """All contacts; a single one is on the line of action of the load, if it may be there."""
        contacts = self.proximity.contacts(placement, tolerance)
        if len(contacts) > 1:
            return contacts
        near = self.proximity.minima(placement, tolerance)
        nearest = near.only([np.argmin(near.gaps)])
        beneath = self._beneath(placement, nearest)
        moved = Contacts(spatial(beneath.points), -spatial(beneath.normals))
        return contacts if beneath is nearest else moved

    def _settled(self, rest: _Rest) -> Settled:
        contacts = self.contacts(rest.placement, 10.0 * CLOSED * self.size)
        outcome = SettlingOutcome.RESTS if rest.way_down is None else SettlingOutcome.BALANCES
        return Settled(rest.placement, contacts, outcome)
