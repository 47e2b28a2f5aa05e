"""Many contact problems at once: the safety factor and mode of each, by the kernels that judge a single one.

Cases with equally many contacts are judged together. Those without friction, with coincident contacts, in a plane other
than that of the first two coordinates, or for which no motion is found are judged one by one.
"""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, fields, replace
from itertools import repeat
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from incipient.arrays import Booleans, Floats, Integers, unwarned
from incipient.contact.acceleration import (
    MODES,
    MOTIONS,
    NO_LOAD,
    Mode,
    classify_motions,
    is_inertia,
)
from incipient.contact.friction import FRICTIONLESS, INFINITE
from incipient.contact.problem import Load, Loads, contact_frames, wrench_basis
from incipient.contact.safety import FAILED as FAILED_ROW
from incipient.contact.safety import HELD, SAFETY, TOLERANCE
from incipient.contact.verdict import MassAndInertia, judged
from incipient.errors import ConvergenceError, SceneError, shortened
from incipient.geometry.contacts import UNIT_TOLERANCE, Contacts
from incipient.parallel import end_with_parent

__all__ = ["LABELS", "Batch", "Cases", "Loads", "judge_batch", "judge_many"]

CHUNK = 10_000  # cases at a time
SMALLEST = 1e-100  # squares of smaller magnitudes vanish: such cases are judged one by one
APART = 1e-9  # of the longest arm: nearer contacts with the same normal are judged one by one
SOLID = 1e-8  # determinant of the moments of a case's unit vectors above which they are in no plane
KEPT = 4  # motions kept of a case
FAILED = -1  # the mode of a case that cannot be judged
LABELS = ("rest", "moves", *(mode.label for mode in MODES if mode is not Mode.REST))


@dataclass(frozen=True, eq=False)
class Cases:
    """n cases of up to k contacts; in the plane third components are zero.

    points, normals: (n, k, 3), unit normals out of the grain; a case with fewer contacts ends with NaN
    force, couple, weight, centre: (n, 3) of the flow, the couple about the centre of mass, and all else that acts there
    friction: (n,); mass: (n,), inertia: (n, 3, 3) about the centre, NaN where they are not known
    """

    points: Floats
    normals: Floats
    force: Floats
    couple: Floats
    weight: Floats
    centre: Floats
    friction: Floats
    mass: Floats
    inertia: Floats

    def __post_init__(self) -> None:
        count, most = (
            len(self.friction),
            np.shape(self.points)[1] if np.ndim(self.points) == 3 else 0,
        )
        shapes: dict[str, tuple[int, ...]]
        shapes = {"points": (count, most, 3), "normals": (count, most, 3), "inertia": (count, 3, 3)}
        shapes |= {name: (count, 3) for name in ("force", "couple", "weight", "centre")}
        for item in fields(self):
            value = np.asarray(getattr(self, item.name), dtype=float)
            if value.shape != (wanted := shapes.get(item.name, (count,))):
                raise SceneError(f"cases: {item.name} has shape {value.shape}; give {wanted}")
            object.__setattr__(self, item.name, value)

    def __len__(self) -> int:
        return len(self.friction)

    def part(self, rows: Integers | Booleans | slice) -> Cases:
        """The cases at places `rows`."""
        return Cases(*(getattr(self, item.name)[rows] for item in fields(self)))

    def turned(self, shift: int) -> Cases:
        """The cases with coordinates exchanged in a circle."""
        vectors = ("points", "normals", "force", "couple", "weight", "centre")
        rolled = {name: np.roll(getattr(self, name), shift, axis=-1) for name in vectors}
        inertia = np.roll(self.inertia, (shift, shift), axis=(1, 2))
        return replace(self, **rolled, inertia=inertia)

    @property
    def contacts(self) -> Integers:
        """How many contacts each case has, (n,): up to the last that is not NaN throughout."""
        there = ~np.isnan(np.concatenate([self.points, self.normals], axis=2)).all(axis=2)
        return np.asarray((there * np.arange(1, there.shape[1] + 1)).max(axis=1, initial=0))

    def case(self, number: int) -> tuple[Load, Contacts, float, MassAndInertia | None]:
        """One of them, as `judged` takes it; raises SceneError."""
        held = [getattr(self, name)[number] for name in ("force", "couple", "weight", "centre")]
        count = int(self.contacts[number])
        contacts = Contacts(self.points[number, :count], self.normals[number, :count])
        mass, inertia = float(self.mass[number]), self.inertia[number]
        known = None if np.isnan(mass) and np.isnan(inertia).all() else (mass, inertia)
        return Load(*held), contacts, float(self.friction[number]), known


@dataclass(frozen=True, eq=False)
class Batch:
    """Verdicts of the exact criterion on n cases."""

    factors: Floats  # (n,) safety factors; NaN where a case fails
    held: Booleans  # (n,) whether the load as it is is balanced
    modes: Integers  # (n,) places in `labels`, which are those of `Exact.label`; FAILED where a case fails
    labels: tuple[str, ...]
    alone: int  # how many were judged one by one
    reasons: dict[int, str]  # why cases fail, by their places

    @property
    def mode_names(self) -> list[str]:
        """The modes in words, "" where a case fails."""
        return ["" if mode == FAILED else self.labels[mode] for mode in self.modes.tolist()]


def judge_many(cases: Cases, jobs: int = 1) -> Batch:
    """Judge cases one like the other: as `exact.judged` does each. Not collective.

    A case that is not right fails with its reason in the answer; the others are not touched by it. In the plane safety
    factors are those of the single judge to round-off, in space to what its cone solver leaves (1e-9).

    Args:
        jobs: processes that share the cases, 10,000 at a time.

    Raises:
        ConvergenceError: a process was ended from outside.
    """
    starts = range(0, len(cases), CHUNK)
    if jobs == 1 or len(starts) < 2:
        return _joined([_judged(cases.part(slice(start, start + CHUNK))) for start in starts])
    # By files: to a pool of which a worker is killed large messages may never arrive.
    with TemporaryDirectory() as directory:
        for item in fields(cases):
            np.save(_file(directory, item.name), getattr(cases, item.name))
        with ProcessPoolExecutor(min(jobs, len(starts)), initializer=end_with_parent) as pool:
            try:
                ends = (start + CHUNK for start in starts)
                return _joined(list(pool.map(_judged_in_files, repeat(directory), starts, ends)))
            except BrokenProcessPool:
                why = "a process was ended, perhaps for want of memory"
                raise ConvergenceError(f"judge_many: {why}; use fewer jobs") from None


def _file(directory: str, name: str) -> Path:
    return Path(directory, f"{name}.npy")


def _judged_in_files(directory: str, start: int, end: int) -> Batch:
    """Judge a part of the cases whose arrays are in files."""
    arrays = (
        np.load(_file(directory, item.name), mmap_mode="r")[start:end] for item in fields(Cases)
    )
    return _judged(Cases(*map(np.array, arrays)))


def judge_batch(
    loads: Loads,
    contacts: Contacts,
    friction: float | Floats,
    mass_and_inertia: MassAndInertia | None = None,
) -> Batch:
    """Judge many loads on one grain and its contacts, as `judge_many` does. Not collective.

    Args:
        friction: the coefficient, or that of each load (n,).

    Raises:
        SceneError: as `exact.judged` does of the first load that cannot be judged.
    """
    count = len(loads)
    mass, inertia = (
        (np.nan, np.full((3, 3), np.nan)) if mass_and_inertia is None else mass_and_inertia
    )

    def each(value: Floats | float) -> Floats:
        return np.broadcast_to(np.asarray(value, dtype=float), (count, *np.shape(value)))

    cases = Cases(
        points=each(contacts.points),
        normals=each(contacts.normals),
        force=loads.force,
        couple=loads.couple,
        weight=loads.weight,
        centre=each(loads.centre),
        friction=np.broadcast_to(np.asarray(friction, dtype=float), count),
        mass=each(mass),
        inertia=each(inertia),
    )
    batch = judge_many(cases)
    if batch.reasons:
        raise SceneError(next(iter(batch.reasons.values())))
    return batch


def _joined(parts: list[Batch]) -> Batch:
    if not parts:
        return Batch(
            np.empty(0), np.empty(0, dtype=bool), np.empty(0, dtype=np.int64), LABELS, 0, {}
        )
    starts = np.cumsum([0, *(len(part.factors) for part in parts)]).tolist()
    reasons = {
        start + place: reason
        for start, part in zip(starts, parts, strict=False)
        for place, reason in part.reasons.items()
    }
    factors, held, modes = (
        np.concatenate([getattr(part, name) for part in parts])
        for name in ("factors", "held", "modes")
    )
    return Batch(factors, held, modes, LABELS, sum(part.alone for part in parts), reasons)


def _judged(cases: Cases) -> Batch:
    count = len(cases)
    factors, held = np.full(count, np.nan), np.zeros(count, dtype=bool)
    modes, left = np.full(count, FAILED), np.ones(count, dtype=bool)
    reasons: dict[int, str] = {}
    with unwarned():
        for places, rows in _groups(cases):
            try:
                factors[places], held[places], modes[places] = rows.verdicts()
            except (ArithmeticError, ValueError):  # numbers out of all proportion
                continue  # each is judged by itself
            left[places] = modes[places] == FAILED
        for place in np.flatnonzero(left).tolist():
            try:
                exact = judged(*cases.case(place))
            except (SceneError, ConvergenceError) as error:
                reasons[place] = str(error)
            except (
                Exception
            ) as error:  # numbers out of all proportion; one case does not end the others
                why = shortened(error) or type(error).__name__
                reasons[place] = f"cannot be judged ({why}); give numbers of a size with the others"
            else:
                factors[place], held[place] = exact.safety.value, not exact.moves
                modes[place] = LABELS.index(exact.label)
            if place in reasons:
                factors[place], held[place] = np.nan, False
    return Batch(factors, held, modes, LABELS, int(left.sum()), reasons)


@dataclass(frozen=True, eq=False)
class _Rows:
    """n dimensionless problems of k contacts: inward normals (n, k, 3), wrenches (n, 6, 3k) of unit local forces."""

    inward: Floats
    columns: Floats
    friction: Floats
    inertia: Floats  # (n, 3, 3) over mass and squared arm
    # Unit wrenches (n, 6) and their magnitudes (n,).
    flow: Floats
    weight: Floats
    flow_size: Floats
    weight_size: Floats
    planar: bool

    def verdicts(self) -> tuple[Floats, Booleans, Integers]:
        """Safety factors, whether held, and modes as of `LABELS`, (n,); FAILED where no motion is found."""
        count, kept = len(self.friction), [0, 1, 5] if self.planar else [0, 1, 2, 3, 4, 5]
        columns = np.ascontiguousarray(self.columns[:, kept])
        arguments = self._cones(columns), self.flow[:, kept].copy(), self.weight[:, kept].copy()
        linear = arguments[0].shape[2] if self.planar else 0
        low, high, weight, _ = SAFETY(*arguments, linear, rows=count)
        unit = np.where(self.weight_size > 0.0, self.weight_size, self.flow_size)
        ratio = unit / np.where(self.flow_size > 0.0, self.flow_size, unit)
        held = (low * ratio <= 1.0 + TOLERANCE) & (high * ratio >= 1.0 - TOLERANCE)
        modes = np.where(held, 0, 1)
        moving = np.flatnonzero(~held & (weight != FAILED_ROW) & np.isfinite(self.inertia[:, 0, 0]))
        if len(moving):
            modes[moving] = self._modes(moving, columns[moving], kept)
        modes[weight == FAILED_ROW] = FAILED
        return np.where(weight == HELD, high * ratio, 0.0), held, modes

    def _cones(self, columns: Floats) -> Floats:
        """Wrenches (n, m, h) of the edges of friction cones in 2-D, of unit circular cones in 3-D."""
        cosine = 1.0 / np.hypot(1.0, self.friction)[:, None, None, None]
        sine = self.friction[:, None, None, None] * cosine
        local = columns.reshape(*columns.shape[:2], -1, 3)
        normal, shear = cosine * local[..., :1], sine * local[..., 1:]
        if self.planar:
            shear, normal = np.zeros(0), normal + sine * local[..., 1:2] * [1.0, -1.0]
        parts = [normal] if self.planar else [normal, shear]
        return np.concatenate(parts, axis=3).reshape(*columns.shape[:2], -1)

    def _modes(self, moving: Integers, columns: Floats, kept: list[int]) -> Integers:
        """The modes of the rows that move."""
        whole = (
            self.flow_size[moving, None] * self.flow[moving]
            + self.weight_size[moving, None] * self.weight[moving]
        )
        whole = whole / np.linalg.norm(whole, axis=1, keepdims=True)
        inverse = np.broadcast_to(np.eye(6), (len(moving), 6, 6)).copy()
        inverse[:, 3:, 3:] = np.linalg.inv(self.inertia[moving])
        small = np.ascontiguousarray(inverse[:, kept][:, :, kept])
        arguments = columns, small, self.friction[moving], whole[:, kept].copy()
        count, accelerations, _ = MOTIONS(*arguments, KEPT, rows=len(moving))
        best = np.zeros((len(moving), 6))
        best[:, kept] = accelerations[:, 0, :-1]
        scale = np.linalg.norm((small @ whole[:, kept, None])[..., 0], axis=1)
        kinds = classify_motions(best, self.columns[moving], scale, self.inward[moving])[2]
        return np.where((count > 0) & (kinds > 0), kinds + 1, FAILED)


def _groups(cases: Cases) -> Iterator[tuple[Integers, _Rows]]:
    """Places of cases that can be judged together, and their problems."""
    counts = cases.contacts
    for count in np.unique(counts[counts > 0]).tolist():
        places = np.flatnonzero(counts == count)
        some = cases.part(places)
        left = np.ones(len(places), dtype=bool)
        for shift in range(3):  # until the plane is that of the first two coordinates
            turned = some.turned(shift)
            usual, solid, planar = _usual(turned, count)
            if (flat := left & usual & planar).any():
                yield places[flat], _rows(turned.part(flat), count, True)
            left &= ~planar
        if (left := left & usual & solid).any():
            yield places[left], _rows(turned.part(left), count, False)


def _rows(cases: Cases, count: int, planar: bool) -> _Rows:
    """The dimensionless problems of cases of so many contacts."""
    arms = cases.points[:, :count] - cases.centre[:, None]
    reach = np.linalg.norm(arms, axis=2).max(axis=1)
    normals = cases.normals[:, :count].reshape(-1, 3)
    inward = -normals / np.linalg.norm(normals, axis=1)[:, None]
    frames = contact_frames(inward, np.eye(3)[2] if planar else None)
    basis = wrench_basis((arms / reach[:, None, None]).reshape(-1, 3), frames)
    flow = np.concatenate([cases.force, cases.couple / reach[:, None]], axis=1)
    weight = np.concatenate([cases.weight, np.zeros_like(cases.weight)], axis=1)
    sizes = np.linalg.norm(flow, axis=1), np.linalg.norm(weight, axis=1)
    flow, weight = (
        wrench / np.where(size > 0.0, size, 1.0)[:, None]
        for wrench, size in zip((flow, weight), sizes, strict=True)
    )
    return _Rows(
        inward.reshape(len(cases), count, 3),
        basis.reshape(6, len(cases), -1).transpose(1, 0, 2),
        cases.friction,
        cases.inertia / (cases.mass * reach**2)[:, None, None],
        flow,
        weight,
        *sizes,
        planar,
    )


def _usual(cases: Cases, count: int) -> tuple[Booleans, Booleans, Booleans]:
    """Which cases of so many contacts are right, which are in no plane, and which in that of the first axes, (n,)."""
    arms, normals = cases.points[:, :count] - cases.centre[:, None], cases.normals[:, :count]
    reach = np.linalg.norm(arms, axis=2).max(axis=1)
    loads = np.stack([cases.force, cases.weight], axis=1)
    sizes = np.linalg.norm(loads, axis=2).sum(axis=1) + np.linalg.norm(cases.couple, axis=1) / reach
    across = [arms[..., 2], normals[..., 2], loads[..., 2], cases.couple[:, :2]]
    planar = ~np.concatenate([*across, np.nan_to_num(cases.inertia[:, 2, :2])], axis=1).any(axis=1)
    lengths = np.linalg.norm(loads, axis=2, keepdims=True)
    loads = loads / np.maximum(lengths, 1e-300)
    vectors = np.concatenate([arms / reach[:, None, None], normals, loads], axis=1)
    solid = np.linalg.det(np.nan_to_num(vectors.transpose(0, 2, 1) @ vectors)) > SOLID
    both = vectors[:, :count], normals
    one, other = np.triu_indices(count, 1)
    apart = np.maximum(*(np.abs(part[:, one] - part[:, other]).max(axis=2) for part in both))
    whole = np.linalg.norm(cases.force + cases.weight, axis=1)
    whole = whole + np.linalg.norm(cases.couple, axis=1) / reach
    right = (apart > APART).all(axis=1) & np.isfinite(sizes) & (sizes > 0.0)
    right &= ((lengths > SMALLEST) | (loads == 0.0)).all(axis=(1, 2)) & (reach > SMALLEST)
    right &= (whole > NO_LOAD * sizes) & np.isfinite(vectors).all(axis=(1, 2))
    right &= (np.abs(np.linalg.norm(normals, axis=2) - 1.0) <= UNIT_TOLERANCE).all(axis=1)
    right &= (cases.friction > FRICTIONLESS) & (cases.friction <= INFINITE)
    right &= ((arms * normals).sum(axis=2) >= 0.0).any(axis=1)
    ratio = np.trace(cases.inertia, axis1=1, axis2=2) / (cases.mass * reach**2)
    unknown = np.isnan(cases.mass) & np.isnan(cases.inertia).all(axis=(1, 2))
    return (
        right
        & (unknown | is_inertia(cases.mass, cases.inertia) & (np.abs(np.log10(ratio)) < 12.0)),
        solid,
        planar,
    )
