"""The contact problem in numbers of order one: what both questions of the exact judge start from.

Lengths are divided by the longest arm from the centre of mass and forces by their own size. A wrench is force
and couple about the centre in one array (6,). Contacts at one place with one normal are one contact here. Each
contact has a frame whose first axis is the inward normal: a local force is (normal, two tangential). A case
whose contacts and load lie in one plane through the centre is planar, however that plane is turned.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from incipient.arrays import Floats, Integers, cross
from incipient.contact.friction_law import FrictionLaw
from incipient.contact.model import Load, require_outward
from incipient.geometry.contacts import Contacts

PLANAR = 1e-12  # how far, in numbers of order one, a planar case may be from its plane
SOLID = 1e-6  # determinant of the normals' moments above which they certainly are in no plane
SAME_PLACE = 1e-12  # of the longest arm
SKEW = np.zeros((3, 9))  # of a vector: the nine entries of the matrix of its vector product
SKEW[[2, 1, 2, 0, 1, 0], [1, 2, 3, 5, 6, 7]] = -1.0, 1.0, 1.0, -1.0, -1.0, 1.0


@dataclass(frozen=True, eq=False)
class Grasp:
    """k different contacts: where they are and which forces they can carry, without units."""

    # (k, 3, 3): rows inward normal and two tangents, the second across the plane of a planar case
    frames: Floats
    matrix: Floats  # (6, k, 3): the wrench of unit local forces
    copy: Integers  # (n,): which of the k each contact given is
    share: Floats  # (n,): its part of that one's force
    reach: float  # the unit of length
    law: FrictionLaw
    plane: Floats | None  # (3, 3): two axes in the plane and its normal if the case is planar

    def __len__(self) -> int:
        return len(self.frames)

    @cached_property
    def columns(self) -> Floats:
        """`matrix` as (6, 3k)."""
        return self.matrix.reshape(6, -1)

    @cached_property
    def fan(self) -> Floats | None:
        """Local forces (g, 3) whose sums with factors >= 0 are the friction cone; None if it is circular."""
        return self.law.fan(self.plane is not None)

    def forces(self, local: Floats) -> Floats:
        """Local forces (k, 3) as forces (n, 3) on the grain at the contacts given."""
        return np.asarray(self.share[:, None] * (local[:, None] @ self.frames)[self.copy, 0])


@dataclass(frozen=True, eq=False)
class Wrenches:
    """The wrenches (6,) of flow and weight as unit vectors, or zero, and their sizes in units of force."""

    flow: Floats
    weight: Floats
    flow_size: float
    weight_size: float

    def at(self, factor: float) -> tuple[Floats, float]:
        """`factor` times the flow and the weight together, over the sum of both sizes, and that sum."""
        size = factor * self.flow_size + self.weight_size
        whole = factor * self.flow_size * self.flow + self.weight_size * self.weight
        return (whole / size if size > 0.0 else whole), size


def grasp(load: Load, contacts: Contacts, friction: float, inertia: Floats | None = None) -> Grasp:
    """Contacts, frames and plane of a case; the plane is used only if `inertia` (3, 3) keeps motion in it.

    Raises SceneError if friction is negative or not a number (it may be infinite), and if all normals point
    toward the centre of mass.
    """
    law = FrictionLaw(float(friction))
    require_outward(contacts, load.centre)
    arms = contacts.points - load.centre
    reach = max(math.hypot(*arm) for arm in arms.tolist()) or 1.0
    kept, copy, share = _distinct(arms / reach, contacts.normals)
    arms, inward = arms[kept] / reach, -contacts.normals[kept]
    plane = _plane(arms, inward, load, inertia)
    frames = _frames(inward, None if plane is None else plane[2])
    matrix = np.empty((6, *frames.shape[:2]))
    matrix[:3] = frames.transpose(2, 0, 1)
    matrix[3:] = (_skew(arms) @ frames.transpose(0, 2, 1)).transpose(1, 0, 2)
    return Grasp(frames, matrix, copy, share, reach, law, plane)


def wrenches(load: Load, reach: float) -> Wrenches:
    """The two wrenches of a load about its centre, couples divided by the unit of length."""
    parts = np.zeros((2, 6))
    parts[0, :3], parts[0, 3:], parts[1, :3] = (
        load.flow_force,
        load.flow_couple / reach,
        load.weight,
    )
    flow, weight = (_length(part) for part in parts)
    return Wrenches(parts[0] / (flow or 1.0), parts[1] / (weight or 1.0), flow, weight)


def leave_plane(plane: Floats, changes: Floats) -> bool:
    """Whether changes (6, m) of force and couple leave the plane (3, 3) of a case."""
    sizes = np.sqrt((changes * changes).sum(axis=0))
    across = np.vstack([plane[2] @ changes[:3], plane[:2] @ changes[3:]])
    return bool((np.abs(across) > PLANAR * sizes).any())


def _skew(vectors: Floats) -> Floats:
    """The matrices (k, 3, 3) that take others to the vector products of vectors (k, 3) with them."""
    return np.asarray((vectors @ SKEW).reshape(-1, 3, 3))


def _distinct(arms: Floats, normals: Floats) -> tuple[Integers, Integers, Floats]:
    """Indices of the different contacts, for every contact which of them it is, and its share."""
    rows = np.concatenate([arms, normals], axis=1)
    same = np.abs(rows[:, None] - rows).max(axis=2) <= SAME_PLACE
    count = len(rows)
    if np.count_nonzero(same) == count:
        return np.arange(count), np.arange(count), np.ones(count)
    kept, copy = np.unique(same.argmax(axis=1), return_inverse=True)
    return kept, copy, 1.0 / same.sum(axis=1)


def _frames(inward: Floats, across: Floats | None) -> Floats:
    """(k, 3, 3): normal, tangent, tangent; the last is `across` if that is given."""
    turns, frames = _skew(inward), np.empty((len(inward), 3, 3))
    if across is None:
        first = turns[np.arange(len(inward)), :, np.abs(inward).argmin(axis=1)]
        first /= np.sqrt(np.einsum("kj,kj->k", first, first))[:, None]
    else:
        first = -turns @ across
    frames[:, 0], frames[:, 1] = inward, first
    frames[:, 2] = (turns @ first[:, :, None])[:, :, 0]
    return frames


def _plane(arms: Floats, inward: Floats, load: Load, inertia: Floats | None) -> Floats | None:
    """(3, 3): two axes in the plane of the case and its normal; None if there is no such plane."""
    if is_solid(inward):
        return None
    inside = [part / _length(part) for part in (load.flow_force, load.weight) if part.any()]
    vectors = np.vstack([arms, inward, *inside])
    couple = load.flow_couple / (_length(load.flow_couple) or 1.0)
    axes = _axes(vectors, couple)
    if (
        np.abs(vectors @ axes[2]).max() > PLANAR
        or np.abs(couple - couple @ axes[2] * axes[2]).max() > PLANAR
    ):
        return None
    if inertia is not None:
        # A planar load gives a planar motion only if the normal of the plane is a principal axis.
        along = inertia @ axes[2]
        if np.abs(along - along @ axes[2] * axes[2]).max() > PLANAR * np.abs(inertia).max():
            return None
    return axes


def is_solid(inward: Floats) -> bool:
    """Whether normals (k, 3) alone keep a case from being planar, whatever the load."""
    return len(inward) > 2 and _determinant(inward.T @ inward) > SOLID


def _axes(vectors: Floats, couple: Floats) -> Floats:
    """The axes (3, 3) of the plane nearest to vectors; where they are on one line, of that across the couple."""
    if not (vectors[:, 2].any() or couple[:2].any()):
        return np.eye(3)
    _, sizes, axes = np.linalg.svd(vectors)
    if sizes[1] <= PLANAR * sizes[0] and couple.any():
        across = couple - couple @ axes[0] * axes[0]
        if _length(across) > 0.5:
            axes[2] = across / _length(across)
    axes[1] = cross(axes[2], axes[0])
    return np.asarray(axes)


def _determinant(matrix: Floats) -> float:
    (a, b, c), (d, e, f), (g, h, i) = matrix.tolist()
    return float(a * (e * i - f * h) + b * (f * g - d * i) + c * (d * h - e * g))


def _length(vector: Floats) -> float:
    return math.hypot(
        *vector.tolist()
    )  # which neither overflows nor underflows, whatever the units
