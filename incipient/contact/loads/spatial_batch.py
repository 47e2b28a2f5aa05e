"""Many loads in space on one grain and its contacts: what depends on the contacts alone is computed once.

Safety factors come from one compiled loop (`compiled_shares`), with how far each may be off; the motions of loads that
are not held from the search of the single judge, which the same contacts share but for the load. Loads near to a
boundary, or whose answer is not sure enough, are left to the single judge.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from incipient.arrays import Booleans, Floats, Integers
from incipient.contact.exact.grasp import grasp, is_solid
from incipient.contact.exact.judge import MassAndInertia
from incipient.contact.exact.motion import ZERO, reading
from incipient.contact.exact.motion_modes import Mode
from incipient.contact.exact.release import NO_LOAD, Candidate, Release, frictionless, release
from incipient.contact.exact.safety import NEARLY_ALL
from incipient.contact.exact.spatial_motion import coulomb, spatial_solutions
from incipient.contact.exact.support import Circular, support
from incipient.contact.model import Loads
from incipient.geometry.contacts import Contacts

FEW = 100  # loads up to which they are judged one by one: the compiled loop takes a second to be there
SURE = 1e-9  # relative error of a safety factor that counts as none
CLEAR = 1e-7  # of the critical load: what is nearer to it than that is judged by itself
NEAR_ZERO = 10.0  # factor on the acceleration that counts as zero, within which it is judged by itself
SAME_ENERGY = 1e-6  # relative: motions whose energies are nearer than that are ordered by the single judge


@dataclass(frozen=True, eq=False)
class Spatial:
    """A case in space: what its contacts carry, and its release under one of the loads, None without inertia."""

    carried: Circular
    case: Release | None
    # The function of `compiled_shares`, which takes numba.
    largest_shares: Callable[[Floats, Floats, Floats], tuple[Floats, Floats, Floats]]

    @classmethod
    def of(
        cls, loads: Loads, contacts: Contacts, friction: float, inert: MassAndInertia | None
    ) -> Spatial | None:
        """The case, if the contacts carry all wrenches in circular cones and lie in no plane; else None."""
        if len(loads) <= FEW:
            return None
        try:
            from incipient.contact.loads.compiled_shares import largest_shares
        except ImportError:  # without numba
            return None
        held_by = grasp(loads.load(0), contacts, friction)
        carried = support(held_by)
        if not isinstance(carried, Circular) or not is_solid(held_by.frames[:, 0]):
            return None
        if carried.balance.beyond.shape[1] or not carried.balance.null.shape[1]:
            return None
        case = None if inert is None else release(loads.load(0), contacts, friction, *inert)
        return cls(carried, case, largest_shares)

    def judged(self, loads: Loads) -> tuple[Floats, Booleans, Integers, Booleans]:
        """Safety factors, whether held, modes as in `Batch`, and which loads are doubtful, (n,) each."""
        flow, flow_size = self._unit(loads.force, loads.couple)
        weight, weight_size = self._unit(loads.weight, np.zeros_like(loads.couple))
        factors, doubtful = self._factors(flow, flow_size, weight, weight_size)
        doubtful |= np.abs(factors - 1.0) <= CLEAR
        held = factors >= 1.0
        modes = np.where(held, 0, 1).astype(np.int64)
        if self.case is not None:
            whole, size = self._unit(loads.force + loads.weight, loads.couple)
            doubtful |= ~held & (size <= NO_LOAD * (flow_size + weight_size))
            for number in np.flatnonzero(~held & ~doubtful).tolist():
                mode = _mode(self.case, whole[number])
                doubtful[number] = mode is None
                modes[number] = 1 if mode is None else 1 + list(Mode).index(mode)
        return factors, held, modes, doubtful

    def _unit(self, force: Floats, couple: Floats) -> tuple[Floats, Floats]:
        """Wrenches (n, 6) of length one, or zero, and their lengths (n,)."""
        whole = np.hstack([force, couple / self.carried.grasp.reach])
        size = np.linalg.norm(whole, axis=1)
        return whole / np.where(size > 0.0, size, 1.0)[:, None], size

    def _factors(
        self, flow: Floats, flow_size: Floats, weight: Floats, weight_size: Floats
    ) -> tuple[Floats, Booleans]:
        """Safety factors, and which are not sure, (n,)."""
        forces = self.carried.balance
        starts, changes = -weight @ forces.inverse.T, (weight - flow) @ forces.inverse.T
        shares, errors, rooms = self.largest_shares(forces.null, starts, changes)
        unlimited = rooms >= 0.0
        sure = errors <= SURE * np.minimum(shares, 1.0 - shares)
        doubtful = ~(unlimited | (sure & (shares < 1.0 - NEARLY_ALL)))
        different, place = np.unique(weight, axis=0, return_inverse=True)
        weight_held = np.array([self.carried.holds(one) for one in different])[place.ravel()]
        doubtful |= (flow_size == 0.0) | (weight_size == 0.0) | ~weight_held
        with np.errstate(divide="ignore", invalid="ignore"):
            factors = shares / (1.0 - shares) * weight_size / flow_size
        return np.where(unlimited, np.inf, np.nan_to_num(factors)), doubtful


def _mode(first: Release, wrench: Floats) -> Mode | None:
    """How the grain begins to move under a wrench (6,) of length one that is not held; None: it is doubtful."""
    case = first.under(wrench)
    start = frictionless(case)
    if np.abs(start.acceleration).max() <= NEAR_ZERO * ZERO * case.scale:
        return None
    found = spatial_solutions(case, coulomb(case), start, rest=False)
    energies = sorted(case.energy(candidate.acceleration) for candidate in found)
    if not found or (len(found) > 1 and energies[1] - energies[0] <= SAME_ENERGY * energies[0]):
        return None
    least = min(found, key=lambda candidate: case.energy(candidate.acceleration))
    return reading(case, least.acceleration).mode if _is_clear(case, least) else None


def _is_clear(case: Release, candidate: Candidate) -> bool:
    """Whether no acceleration of a candidate is near to what counts as zero."""
    zero, at_contacts = ZERO * case.scale, case.at_contacts(candidate.acceleration)
    own = [np.abs(candidate.acceleration).max(), np.abs(candidate.acceleration[3:]).max()]
    along = np.hypot(at_contacts[:, 1], at_contacts[:, 2])
    sizes = np.concatenate([np.abs(at_contacts[:, 0]), along, own])
    return not ((sizes > zero / NEAR_ZERO) & (sizes < zero * NEAR_ZERO)).any()
