"""Contact problems of rigid grains, with lengths over the longest arm.

Wrenches (6,) are force and torque about the centre of mass; planar cases have three equations, others six.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np

from incipient.arrays import Booleans, Floats, Integers, cross
from incipient.contact.friction import FrictionCone, Law, Rows
from incipient.errors import SceneError
from incipient.geometry.contacts import Contacts, coincident, freeze, shares, tangents

PLANAR = 1e-12  # dimensionless distance from a coordinate plane below which a case is planar
IN_PLANE = np.array([[1, 2, 3], [2, 0, 4], [0, 1, 5]])  # components of a wrench, by normal axis
TINY = 1e-300  # avoids division by zero


@dataclass(frozen=True, eq=False)
class Load:
    """Force, torque and weight on the grain, each (3,), without contact forces.

    `flow_couple`: torque of the flow about `centre`, the centre of mass; `weight`: all other forces
    at `centre`. Raises SceneError unless each has three finite components.
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
        """F_flow&g of (9), (3,)."""
        return self.flow_force + self.weight

    @property
    def wrenches(self) -> Floats:
        """Wrenches (2, 6) of flow and weight."""
        flow = [*self.flow_force, *self.flow_couple]
        return np.array([flow, [*self.weight, 0.0, 0.0, 0.0]])

    def shifted(self, change: Floats) -> Load:
        """Add a wrench (6,) to the flow's force and torque."""
        force, torque = self.flow_force + change[:3], self.flow_couple + change[3:]
        return Load(force, torque, self.weight, self.centre)


@dataclass(frozen=True, eq=False)
class ContactProblem:
    """n cases of k distinct contacts each, lengths over `reach`.

    `arms`, `inward` (n, k, 3): contact points from the centre of mass over `reach` (n,), and inward
    normals. `wrenches` (n, j, 6): of flow, weight and errors of the flow, torques over `reach`. `pull`
    (n, k): cohesion. `normal_axis` (n,): that across the coordinate planes of planar cases. `copy`,
    `fraction` (i,): the distinct contact of each input contact, and its fraction of the force.
    """

    arms: Floats
    inward: Floats
    reach: Floats
    wrenches: Floats
    law: FrictionCone
    pull: Floats
    normal_axis: Integers | None
    copy: Integers
    fraction: Floats

    @classmethod
    def of(
        cls,
        load: Load,
        contacts: Contacts,
        law: Law,
        inertia: Floats | None = None,
        errors: Floats | None = None,
    ) -> ContactProblem:
        """Build a single case, planar only if `inertia` (3, 3) and errors (j, 6) of the flow allow it.

        Raises SceneError.
        """
        arms = contacts.points - load.centre
        require_outward(arms, contacts.normals)
        kept, copy, fraction = _distinct(arms, contacts.normals)
        loads = load.wrenches if errors is None else np.concatenate([load.wrenches, errors])
        surface = arms[None, kept], contacts.normals[None, kept]
        areas = None
        if contacts.areas is not None:
            areas = np.bincount(copy, contacts.areas).astype(float)[None]
        problem = cls.of_rows(*surface, loads[None], FrictionCone.of(law).rows(1), areas)
        normal, planar = problem.planes(None if inertia is None else inertia[None])
        return replace(
            problem, normal_axis=normal if planar[0] else None, copy=copy, fraction=fraction
        )

    @classmethod
    def of_rows(
        cls,
        arms: Floats,
        normals: Floats,
        loads: Floats,
        law: FrictionCone,
        areas: Floats | None,
    ) -> ContactProblem:
        """Build non-planar cases from arms and unit normals (n, k, 3), wrenches (n, j, 6) of flow, weight and errors,
        and areas (n, k) by which the points of a contact share its cohesion.
        """
        count, k, _ = arms.shape
        reach = np.sqrt((arms * arms).sum(axis=2).max(axis=1))
        reach[reach == 0.0] = 1.0
        wrenches = loads / np.where(np.arange(6) < 3, 1.0, reach[:, None])[:, None]
        pull = np.zeros((count, k))
        if law.is_cohesive:  # cone forces include cohesion, which pulls the grain to the bed
            pull = law.cohesion[:, None] * shares(arms, normals, areas)
            pulls = pull[:, :, None] * normals
            wrenches[:, 1, :3] += pulls.sum(axis=1)
            wrenches[:, 1, 3:] = cross(arms, pulls).sum(axis=1) / reach[:, None]
        scaled = arms / reach[:, None, None], -normals, reach, wrenches
        return cls(*scaled, law, pull, None, np.arange(k), np.ones(k))

    def planes(self, inertia: Floats | None = None) -> tuple[Integers, Booleans]:
        """Normal axes (n,) of coordinate planes, and a mask (n,) of planar cases.

        With `inertia` (n, 3, 3), planar cases need the normal as a principal axis.
        """
        vectors = np.concatenate([self.arms, self.inward, self.units[:, :, :3]], axis=1)
        torque = np.abs(self.units[:, :, 3:]).max(axis=1)
        outside = np.abs(vectors).max(axis=1) + torque.sum(axis=1, keepdims=True) - torque
        if inertia is not None:
            moments = np.abs(inertia)
            products = moments.sum(axis=2) - np.diagonal(moments, axis1=1, axis2=2)
            outside = np.fmax(outside, products / moments.max(axis=(1, 2))[:, None])
        return 2 - outside[:, ::-1].argmin(axis=1), outside.min(axis=1) <= PLANAR

    def __len__(self) -> int:
        return len(self.arms)

    def part(self, rows: Rows) -> ContactProblem:
        """The cases of some rows."""
        names = ["arms", "inward", "reach", "wrenches", "law", "pull"]
        names += [] if self.normal_axis is None else ["normal_axis"]
        changes: dict[str, Any] = {name: getattr(self, name)[rows] for name in names}
        return replace(self, **changes)

    @cached_property
    def sizes(self) -> Floats:
        """Magnitudes (n, j) of the wrenches."""
        return np.sqrt((self.wrenches * self.wrenches).sum(axis=2))

    @cached_property
    def units(self) -> Floats:
        """Wrenches (n, j, 6) of length one, or zero."""
        return self.wrenches / np.maximum(self.sizes, TINY)[:, :, None]

    @cached_property
    def frames(self) -> Floats:
        """Inward normal and two tangents, (n, k, 3, 3), the second out of plane in planar cases."""
        across = None if self.normal_axis is None else np.eye(3)[self.normal_axis, None]
        return contact_frames(self.inward, across)

    @cached_property
    def basis(self) -> Floats:
        """Wrenches (n, 6, k, 3) of unit local forces."""
        return unit_wrenches(self.arms, self.frames)

    @property
    def columns(self) -> Floats:
        return self.basis.reshape(*self.basis.shape[:2], -1)

    @cached_property
    def generators(self) -> Floats:
        """Local forces (n, g, 3) that span the friction cones."""
        return self.law.generators(self.normal_axis is not None)

    @cached_property
    def cone_columns(self) -> Floats:
        """Wrenches (n, m, h) of the cones' generators."""
        columns = self.basis @ self.generators[:, None].swapaxes(2, 3)
        return self.within(columns.reshape(*columns.shape[:2], -1))

    @property
    def linear(self) -> int:
        """Number of non-negative multipliers, zero for circular cones."""
        return 0 if self.generators.shape[1] == 3 else self.cone_columns.shape[2]

    def local(self, factors: Floats) -> Floats:
        """Local forces (n, k, 3) of multipliers (n, h) of `cone_columns`."""
        return np.asarray(factors.reshape(len(self), self.arms.shape[1], -1) @ self.generators)

    def within(self, wrenches: Floats) -> Floats:
        """Components (n, m, j) of wrenches (n, 6, j): all, m = 6, or those in the plane, m = 3."""
        if self.normal_axis is None:
            return wrenches
        return wrenches[np.arange(len(self))[:, None], IN_PLANE[self.normal_axis]]

    def wrench(self, factor: float) -> tuple[Floats, Floats]:
        """`factor` times flow and weight, (n, 6), over the sum of their magnitudes (n,), and that sum."""
        sizes = self.sizes[:, :2] * [factor, 1.0]
        size = sizes.sum(axis=1)
        whole = (sizes[:, :, None] * self.units[:, :2]).sum(axis=1)
        return whole / np.maximum(size, TINY)[:, None], size

    def forces(self, local: Floats) -> Floats:
        """Forces (j, 3) on the grain at the input contacts from local forces (k, 3) of a single case."""
        local = local - self.pull[0, :, None] * [1.0, 0.0, 0.0]
        return np.asarray(self.fraction[:, None] * (local[:, None] @ self.frames[0])[self.copy, 0])


def unit_wrenches(arms: Floats, frames: Floats) -> Floats:
    """Wrenches (n, 6, k, 3) of unit forces along frames (n, k, 3, 3) at arms (n, k, 3)."""
    both = np.concatenate([frames, cross(arms[:, :, None], frames)], axis=3)
    return np.ascontiguousarray(both.transpose(0, 3, 1, 2))


def require_outward(arms: Floats, normals: Floats) -> None:
    """Raise SceneError if all normals (k, 3) point towards the centre of mass, a sign error."""
    if ((arms * normals).sum(axis=1) < 0.0).all():
        raise SceneError(
            "contacts: all normals point into the grain; give them pointing out, into the bed"
        )


def contact_frames(inward: Floats, across: Floats | None) -> Floats:
    """Inward normals (..., 3) and two tangents, (..., 3, 3); `across` (..., 3), if any, is the last tangent."""
    if across is None:
        first, second = tangents(inward)
    else:
        first, second = cross(across, inward), across
    return np.stack(np.broadcast_arrays(inward, first, second), axis=-2)


def _distinct(arms: Floats, normals: Floats) -> tuple[Integers, Integers, Floats]:
    """Indices of distinct contacts; the distinct contact of each contact, and its fraction."""
    same = coincident(arms, normals, 1e-12 * np.abs(arms).max(), 1e-12)
    kept, copy = np.unique(same.argmax(axis=1), return_inverse=True)
    return kept, copy, 1.0 / same.sum(axis=1)
