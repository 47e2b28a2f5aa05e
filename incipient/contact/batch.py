"""Many cases at once: the exact judge's safety factor and mode for each, of one set of contacts or of many.

Cases with equally many contacts are judged together: in the plane by `planar_rows`, in space by `spatial_rows`. What
lies too near to a boundary for that, and what is not right, is judged one by one.
"""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, fields
from itertools import repeat
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from incipient.arrays import Booleans, Floats, Integers, unwarned
from incipient.contact.exact.judge import MassAndInertia, judged
from incipient.contact.exact.motion_modes import Mode
from incipient.contact.exact.release import LARGEST, SYMMETRIC
from incipient.contact.friction_law import FRICTIONLESS
from incipient.contact.loads.planar_rows import MOST_CONTACTS, judged_in_plane
from incipient.contact.loads.rows import Answers, Rows
from incipient.contact.loads.spatial_rows import in_no_plane, judged_in_space
from incipient.contact.model import Load, Loads
from incipient.errors import ConvergenceError, SceneError, shortened
from incipient.geometry.contacts import UNIT_TOLERANCE, Contacts
from incipient.parallel import end_with_parent

__all__ = ["LABELS", "Batch", "Cases", "Loads", "judge_batch", "judge_many"]

CHUNK = 10_000  # cases at a time
FEW = 100  # cases in space up to which they are judged one by one: compiled loops take a second to be there
HUGE = 1e12  # sizes of forces and arms, or one over them, beyond which a case is judged by itself
APART = 1e-9  # of the longest arm: contacts nearer to each other with the same normal are judged one by one
FAILED = -1  # the mode of a case that cannot be judged
LABELS = ("rest", "moves", *(one.label for one in Mode if one is not Mode.REST))


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

    def part(self, rows: Integers | slice) -> Cases:
        """The cases at places `rows`."""
        return Cases(*(getattr(self, item.name)[rows] for item in fields(self)))

    @property
    def contacts(self) -> Integers:
        """How many contacts each case has, (n,): up to the last that is not NaN throughout."""
        there = ~np.isnan(np.concatenate([self.points, self.normals], axis=2)).all(axis=2)
        return np.asarray((there * np.arange(1, there.shape[1] + 1)).max(axis=1, initial=0))

    def case(self, number: int) -> tuple[Load, Contacts, float, MassAndInertia | None]:
        """One of them, as `exact.judged` takes it; raises SceneError."""
        held = [getattr(self, name)[number] for name in ("force", "couple", "weight", "centre")]
        count = int(self.contacts[number])
        contacts = Contacts(self.points[number, :count], self.normals[number, :count])
        mass, inertia = float(self.mass[number]), self.inertia[number]
        known = None if np.isnan(mass) and np.isnan(inertia).all() else (mass, inertia)
        return Load(*held), contacts, float(self.friction[number]), known


@dataclass(frozen=True, eq=False)
class Batch:
    """What the exact judge says of n cases."""

    factors: Floats  # (n,) safety factors; NaN where a case fails
    held: Booleans  # (n,) whether the load as it is is balanced
    modes: Integers  # (n,) places in `labels`, which are as of `exact.Exact.label`; FAILED where a case fails
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
    found = judge_many(cases)
    if found.reasons:
        raise SceneError(next(iter(found.reasons.values())))
    return found


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
    found = Answers(
        np.full(count, np.nan),
        np.zeros(count, dtype=bool),
        np.full(count, FAILED, dtype=np.int64),
        np.ones(count, dtype=bool),
    )
    with unwarned():
        for places, rows, in_plane in _groups(cases):
            try:
                answers = judged_in_plane(rows) if in_plane else judged_in_space(rows)
            except (
                Exception
            ):  # without numba, or numbers out of all proportion: each is judged by itself
                continue
            for item in fields(found):
                getattr(found, item.name)[places] = getattr(answers, item.name)
        reasons, left = dict[int, str](), np.flatnonzero(found.doubtful)
        known: dict[bytes, int] = {}  # what comes several times is judged once
        for place in left.tolist():
            key = b"".join(getattr(cases, item.name)[place].tobytes() for item in fields(cases))
            first = known.setdefault(key, place)
            if first == place:
                _put_alone(cases, place, found, reasons)
            else:
                for name in ("factors", "held", "modes"):
                    getattr(found, name)[place] = getattr(found, name)[first]
                if first in reasons:
                    reasons[place] = reasons[first]
    return Batch(found.factors, found.held, found.modes, LABELS, len(left), reasons)


def _put_alone(cases: Cases, place: int, found: Answers, reasons: dict[int, str]) -> None:
    """Judge one case by itself."""
    found.factors[place], found.held[place], found.modes[place] = np.nan, False, FAILED
    try:
        exact = judged(*cases.case(place))
    except SceneError as error:
        reasons[place] = str(error)
    except Exception as error:  # numbers out of all proportion; one case does not end the others
        why = shortened(error) or type(error).__name__
        reasons[place] = f"cannot be judged ({why}); give numbers of a size with the others"
    else:
        found.factors[place], found.held[place] = exact.safety.value, not exact.moves
        found.modes[place] = LABELS.index(exact.label)


def _groups(cases: Cases) -> Iterator[tuple[Integers, Rows, bool]]:
    """Places of cases with equally many contacts that can be judged together, and whether they are in a plane."""
    counts = cases.contacts
    for count in np.unique(counts[counts > 0]).tolist():
        places = np.flatnonzero(counts == count)
        rows, right = _rows(cases.part(places), count)
        places, rows = places[right], rows.part(right)
        left = np.ones(len(places), dtype=bool)
        for axis in (2, 1, 0):
            flat = (
                np.flatnonzero(left & _in_plane(rows, axis))
                if count <= MOST_CONTACTS
                else np.empty(0, int)
            )
            left[flat] = False
            if len(flat):
                yield places[flat], rows.part(flat).turned(axis), True
        left &= in_no_plane(rows)
        if len(cases) > FEW and left.any():
            yield places[left], rows.part(left), False


def _in_plane(rows: Rows, axis: int) -> Booleans:
    """Whether nothing leaves the plane across an axis, (n,)."""
    others = [other for other in range(3) if other != axis]
    out = [rows.arms[..., axis], rows.inward[..., axis]]
    out += [
        wrench[:, [axis, *(3 + other for other in others)]] for wrench in (rows.flow, rows.weight)
    ]
    turning = np.nan_to_num(rows.inertia[:, axis, others])
    return ~np.concatenate([*out, turning], axis=1).any(axis=1)


def _rows(cases: Cases, count: int) -> tuple[Rows, Booleans]:
    """Cases of so many contacts in numbers of order one, and which of them are right and of usual sizes, (n,)."""
    points, normals = cases.points[:, :count], cases.normals[:, :count]
    arms = points - cases.centre[:, None]
    reach = np.linalg.norm(arms, axis=2).max(axis=1)
    lengths = np.linalg.norm(normals, axis=2)
    inertia = cases.inertia / (cases.mass * reach**2)[:, None, None]
    flow = np.concatenate([cases.force, cases.couple / reach[:, None]], axis=1)
    weight = np.concatenate([cases.weight, np.zeros_like(cases.weight)], axis=1)
    rows = Rows(
        arms / reach[:, None, None],
        -normals / lengths[..., None],
        cases.friction,
        inertia,
        flow,
        weight,
    )
    sizes = np.stack([reach, *(np.linalg.norm(one, axis=1) for one in (flow, weight))], axis=1)
    right = ((sizes < HUGE) & (sizes > 1.0 / HUGE)).all(axis=1) & np.isfinite(rows.arms).all(
        axis=(1, 2)
    )
    right &= (np.abs(lengths - 1.0) <= UNIT_TOLERANCE).all(axis=1)
    right &= (cases.friction > FRICTIONLESS) & (cases.friction <= LARGEST)
    right &= ((rows.arms * rows.inward).sum(axis=2) <= 0.0).any(axis=1) & _are_apart(rows)
    unknown = np.isnan(cases.mass) & np.isnan(cases.inertia).all(axis=(1, 2))
    return rows, right & (unknown | _is_inertia(cases.mass, inertia))


def _are_apart(rows: Rows) -> Booleans:
    """Whether no two contacts are one, (n,)."""
    both = np.concatenate([rows.arms, rows.inward], axis=2)
    first, second = np.triu_indices(both.shape[1], 1)
    return np.asarray((np.abs(both[:, first] - both[:, second]).max(axis=2) > APART).all(axis=1))


def _is_inertia(mass: Floats, inertia: Floats) -> Booleans:
    """Whether masses (n,) and inertias (n, 3, 3) over them are positive, and neither tiny nor huge, (n,)."""
    usual = np.isfinite(mass) & (mass > 0.0) & (np.abs(inertia) < HUGE).all(axis=(1, 2))
    table = np.where(usual[:, None, None], inertia, np.eye(3))
    largest = np.abs(table).max(axis=(1, 2))
    usual &= np.abs(table - table.transpose(0, 2, 1)).max(axis=(1, 2)) <= SYMMETRIC * largest
    return np.asarray(usual & (np.linalg.eigvalsh(table)[:, 0] > largest / HUGE))
