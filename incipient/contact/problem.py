"""The contact problem of a rigid grain, made dimensionless.

Lengths are divided by the longest arm from the centre of mass and forces by their own magnitude, so that nothing
below depends on units. A wrench (6,) is force and torque about the centre of mass. In a plane case third components
are zero and torques act along the third axis; cases in any other plane through the centre are recognised.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import cached_property
from types import FunctionType
from typing import Any

import numpy as np

from incipient.arrays import Floats, Integers, cross
from incipient.contact.friction import FrictionCone
from incipient.errors import SceneError
from incipient.geometry.contacts import Contacts, freeze

PLANAR = 1e-12  # dimensionless distance from its plane up to which a case is planar
SOLID = 1e-6  # determinant of the normals' second moments above which they span space
SAME_PLACE = 1e-12  # of the longest arm: contacts nearer than that with equal normals are one
# Rows with three equations (2-D), about 2 ms each, before a kernel is compiled: numba takes 0.5 s and 100 MiB to load.
INTERPRETED = 240
AT_ONCE = 20  # rows in one call that are always compiled, so that tables do not depend on what was called before
SKEW = np.zeros((3, 9))  # v @ SKEW are the entries of the matrix of v's vector product
SKEW[[2, 1, 2, 0, 1, 0], [1, 2, 3, 5, 6, 7]] = -1.0, 1.0, 1.0, -1.0, -1.0, 1.0


@dataclass(frozen=True, eq=False)
class Load:
    """What acts on the grain besides the bed, each (3,).

    `flow_force`: the flow's force on the grain; `flow_couple`: its torque about `centre`; `weight`: all else
    that acts at `centre`, the centre of mass, such as weight and buoyancy. Raises SceneError on anything but
    three finite numbers each.
    """

    flow_force: Floats
    flow_couple: Floats
    weight: Floats
    centre: Floats

    def __post_init__(self) -> None:
        for item in fields(self):
            value = np.array(getattr(self, item.name), dtype=float)
            if value.shape != (3,):
                raise SceneError(
                    f"load: {item.name} has shape {value.shape}; give three components"
                )
            if not np.isfinite(value).all():
                raise SceneError(f"load: {item.name} is {value.tolist()}; give finite numbers")
            freeze(self, item.name, value)

    @property
    def force(self) -> Floats:
        """F_flow&g of (9): flow force and weight together, (3,)."""
        return self.flow_force + self.weight

    @property
    def couple(self) -> Floats:
        """tau_flow&g of (21) about the centre of mass, where the weight has no torque, (3,)."""
        return self.flow_couple

    def shifted(self, change: Floats) -> "Load":
        """The load with the flow's force and torque changed by (6,)."""
        return Load(
            self.flow_force + change[:3], self.flow_couple + change[3:], self.weight, self.centre
        )


@dataclass(frozen=True, eq=False)
class Loads:
    """n loads: force and torque of the flow (n, 3), weight (n, 3), and the centre of mass (3,) of the torques.

    Raises SceneError if shapes do not fit or a number is not finite.
    """

    force: Floats
    couple: Floats
    weight: Floats
    centre: Floats

    def __post_init__(self) -> None:
        shape = np.shape(self.force)
        if len(shape) != 2 or shape[1] != 3:
            raise SceneError(f"loads: force has shape {shape}; give (n, 3)")
        object.__setattr__(self, "weight", np.broadcast_to(self.weight, shape))
        for name in ("force", "couple", "weight"):
            value = np.asarray(getattr(self, name), dtype=float)
            if value.shape != shape or not np.isfinite(value).all():
                raise SceneError(
                    f"loads: {name} is not {shape[0]} rows of three finite numbers; give such"
                )
            object.__setattr__(self, name, value)

    def __len__(self) -> int:
        return len(self.force)

    def load(self, number: int) -> Load:
        """The load of one row."""
        return Load(self.force[number], self.couple[number], self.weight[number], self.centre)


@dataclass(frozen=True, eq=False)
class ContactProblem:
    """k distinct contacts and the load on them, dimensionless.

    `plane` (3, 3): two axes in the plane of a planar case and its normal, otherwise None. `copy` (n,): the
    distinct contact of each one given, `fraction` (n,): its fraction of that contact's force.
    """

    frames: Floats  # (k, 3, 3): rows inward normal and two tangents, the second across a plane
    basis: Floats  # (6, k, 3): wrenches of unit local forces
    copy: Integers
    fraction: Floats
    reach: float  # the unit of length
    cone: FrictionCone
    plane: Floats | None
    # Unit wrenches (6,), or zero, and their magnitudes in the caller's units of force.
    flow: Floats
    weight: Floats
    flow_size: float
    weight_size: float

    @classmethod
    def of(
        cls, load: Load, contacts: Contacts, friction: float, inertia: Floats | None = None
    ) -> "ContactProblem":
        """The problem of a case; its plane is used only if `inertia` (3, 3) keeps the motion in it.

        Raises SceneError if friction is negative or not a number, or all normals point into the grain.
        """
        cone, arms = FrictionCone(float(friction)), contacts.points - load.centre
        reach = max(map(_length, arms)) or 1.0
        require_outward(contacts, load.centre)
        kept, copy, fraction = _distinct(arms / reach, contacts.normals)
        arms, inward = arms[kept] / reach, -contacts.normals[kept]
        plane = _plane(arms, inward, load, inertia)
        frames = contact_frames(inward, None if plane is None else plane[2])
        flow = np.concatenate([load.flow_force, load.flow_couple / reach])
        weight = np.concatenate([load.weight, np.zeros(3)])
        sizes = _length(flow), _length(weight)
        unit_flow, unit_weight = flow / (sizes[0] or 1.0), weight / (sizes[1] or 1.0)
        basis = wrench_basis(arms, frames)
        return cls(
            frames, basis, copy, fraction, reach, cone, plane, unit_flow, unit_weight, *sizes
        )

    def __len__(self) -> int:
        return len(self.frames)

    @cached_property
    def columns(self) -> Floats:
        """`basis` as (6, 3k)."""
        return self.basis.reshape(6, -1)

    @cached_property
    def generators(self) -> Floats | None:
        """Local forces (g, 3) that span the friction cone; None if it is circular."""
        return self.cone.generators(self.plane is not None)

    @cached_property
    def projection(self) -> Floats | None:
        """(3, 6): takes wrenches into the plane of a planar case."""
        return None if self.plane is None else plane_projection(self.plane)

    @cached_property
    def cone_columns(self) -> Floats:
        """Wrenches (m, h) of the generators of all cones, or of unit circular cones, three columns each."""
        if self.generators is None:
            return (self.basis * self.cone.scaling).reshape(6, -1)
        columns = (self.basis @ self.generators.T).reshape(6, -1)
        return columns if self.projection is None else self.projection @ columns

    def local(self, factors: Floats) -> Floats:
        """Local forces (k, 3) of the factors (h,) on `cone_columns`."""
        if self.generators is None:
            return np.asarray(factors.reshape(-1, 3) * self.cone.scaling)
        return np.asarray(factors.reshape(-1, len(self.generators)) @ self.generators)

    def within(self, wrench: Floats) -> Floats:
        """A wrench (6,) with as many rows as `cone_columns`."""
        return wrench if self.projection is None else np.asarray(self.projection @ wrench)

    def forces(self, local: Floats) -> Floats:
        """Local forces (k, 3) as forces (n, 3) on the grain at the contacts given."""
        return np.asarray(self.fraction[:, None] * (local[:, None] @ self.frames)[self.copy, 0])

    def wrench(self, factor: float) -> tuple[Floats, float]:
        """(factor flow + weight) over the sum of both magnitudes, and that sum."""
        size = factor * self.flow_size + self.weight_size
        whole = factor * self.flow_size * self.flow + self.weight_size * self.weight
        return (whole / size if size > 0.0 else whole), size


def require_outward(contacts: Contacts, centre: Floats) -> None:
    """Refuse contacts whose normals all point toward the centre of mass: a mistaken sign. Raises SceneError."""
    if (((contacts.points - centre) * contacts.normals).sum(axis=1) < 0.0).all():
        raise SceneError(
            "contacts: all normals point into the grain; give them pointing out, into the bed"
        )


def plane_projection(plane: Floats) -> Floats:
    """The rows (3, 6) that take wrenches and accelerations into a plane (3, 3) of two axes and its normal."""
    rows = np.zeros((3, 6))
    rows[:2, :3], rows[2, 3:] = plane[:2], plane[2]
    return rows


def leave_plane(plane: Floats, changes: Floats) -> bool:
    """Whether changes (6, m) of force and torque leave the plane (3, 3) of a case."""
    across = np.vstack([plane[2] @ changes[:3], plane[:2] @ changes[3:]])
    return bool((np.abs(across) > PLANAR * np.linalg.norm(changes, axis=0)).any())


def contact_frames(inward: Floats, across: Floats | None) -> Floats:
    """(k, 3, 3): inward normal and two tangents; the last is `across` if that is given."""
    turns, frames = _skew(inward), np.empty((*inward.shape, 3))
    if across is None:
        first = turns[np.arange(len(inward)), :, np.abs(inward).argmin(axis=1)]
        first /= np.sqrt((first * first).sum(axis=1))[:, None]
    else:
        first = -turns @ across
    frames[:, 0], frames[:, 1] = inward, first
    frames[:, 2] = (turns @ first[:, :, None])[:, :, 0]
    return frames


def wrench_basis(arms: Floats, frames: Floats) -> Floats:
    """(6, k, 3): wrenches of unit local forces in frames (k, 3, 3) at the ends of arms (k, 3)."""
    basis = np.empty((6, *frames.shape[:2]))
    basis[:3] = frames.transpose(2, 0, 1)
    basis[3:] = (_skew(arms) @ frames.transpose(0, 2, 1)).transpose(1, 0, 2)
    return basis


class Kernel:
    """A function of loops over numbers that runs as it is at first and is compiled by numba if it is called often.

    Compiled code is kept in `__pycache__`, or where NUMBA_CACHE_DIR says.

    Args:
        function: its first argument ends in a matrix for each row.
        interpreted: rows with three equations before it is compiled.
    """

    def __init__(self, function: Callable[..., Any], interpreted: float = INTERPRETED) -> None:
        self.function, self.left = function, interpreted
        self.compiled: Callable[..., Any] | None = None

    def __call__(self, *arguments: Any, rows: int = 1) -> Any:
        """Call it for so many rows, whose work goes by the cube of the number of equations."""
        work = rows * (arguments[0].shape[-2] / 3) ** 3
        self.left -= work
        if (self.left < 0 or work >= AT_ONCE) and self.compiled is None:
            self.compiled = _compiled(self.function) or self.function
        return (self.compiled or self.function)(*arguments)


def _compiled(function: Callable[..., Any]) -> Callable[..., Any] | None:
    """The function and all that it calls, compiled at its first call; None without numba."""
    try:
        from numba import njit  # takes a third of a second
    except ImportError:
        return None
    scope: dict[str, Any] = {}
    for value in list(function.__globals__.values()):
        if isinstance(value, FunctionType) and value.__module__.startswith(__package__):
            scope |= value.__globals__
    scope |= function.__globals__
    options = {"error_model": "numpy", "no_cfunc_wrapper": True}
    for name, value in list(scope.items()):
        if isinstance(value, FunctionType) and value.__module__.startswith(__package__):
            scope[name] = njit(**options)(FunctionType(value.__code__, scope, name))
    entry = FunctionType(function.__code__, scope, function.__name__)
    entry.__module__ = function.__module__
    try:
        return njit(cache=True, **options)(entry)
    except RuntimeError:  # there is no directory that numba can write to
        return njit(**options)(entry)


def _distinct(arms: Floats, normals: Floats) -> tuple[Integers, Integers, Floats]:
    """Indices of the distinct contacts, for every contact which of them it is, and its fraction."""
    rows = np.concatenate([arms, normals], axis=1)
    same = np.abs(rows[:, None] - rows).max(axis=2) <= SAME_PLACE
    count = len(rows)
    if np.count_nonzero(same) == count:
        return np.arange(count), np.arange(count), np.ones(count)
    kept, copy = np.unique(same.argmax(axis=1), return_inverse=True)
    return kept, copy, 1.0 / same.sum(axis=1)


def _plane(arms: Floats, inward: Floats, load: Load, inertia: Floats | None) -> Floats | None:
    """(3, 3): two axes in the plane of the case and its normal; None if there is no such plane."""
    if len(inward) > 2 and np.linalg.det(inward.T @ inward) > SOLID:
        return None
    inside = [part / _length(part) for part in (load.flow_force, load.weight) if part.any()]
    vectors = np.vstack([arms, inward, *inside])
    torque = load.flow_couple / (_length(load.flow_couple) or 1.0)
    axes = _axes(vectors, torque)
    outside = [vectors @ axes[2], torque - torque @ axes[2] * axes[2]]
    if inertia is not None:
        # A planar load gives a planar motion only if the normal of the plane is a principal axis.
        along = inertia @ axes[2]
        outside.append((along - along @ axes[2] * axes[2]) / np.abs(inertia).max())
    return axes if max(np.abs(part).max() for part in outside) <= PLANAR else None


def _axes(vectors: Floats, torque: Floats) -> Floats:
    """Axes (3, 3) of the plane nearest to vectors; where they are on one line, of that across the torque."""
    if not (vectors[:, 2].any() or torque[:2].any()):
        return np.eye(3)
    _, sizes, axes = np.linalg.svd(vectors)
    if sizes[1] <= PLANAR * sizes[0] and torque.any():
        across = torque - torque @ axes[0] * axes[0]
        if _length(across) > 0.5:
            axes[2] = across / _length(across)
    axes[1] = cross(axes[2], axes[0])
    return np.asarray(axes)


def _skew(vectors: Floats) -> Floats:
    """The matrices (k, 3, 3) of the vector products with vectors (k, 3)."""
    return np.asarray((vectors @ SKEW).reshape(-1, 3, 3))


def _length(vector: Floats) -> float:
    return math.hypot(*vector.tolist())  # neither overflows nor underflows, whatever the units
