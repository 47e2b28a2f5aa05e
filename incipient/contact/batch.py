"""Batches of contact problems; frictionless and unconverged cases are evaluated one by one."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np

from incipient.arrays import Booleans, Floats, Integers, unwarned
from incipient.contact.acceleration import MODES, Mode, ReleaseProblem, inertia_faults, inverses
from incipient.contact.conic import FAILED as UNANSWERED
from incipient.contact.conic import HELD
from incipient.contact.friction import FrictionCone, Rows
from incipient.contact.problem import ContactProblem, Load
from incipient.contact.safety import intervals
from incipient.contact.verdict import MassAndInertia, judged
from incipient.errors import ConvergenceError, SceneError, shortened
from incipient.geometry.contacts import UNIT_TOLERANCE, Contacts

CHUNK = 10_000  # cases at a time
FAILED = -1  # mode of an invalid case
LABELS = ("rest", "moves", *(mode.label for mode in MODES if mode is not Mode.REST))


@dataclass(frozen=True, eq=False)
class Cases:
    """n cases of up to k contacts; third components are zero in 2-D. A single value serves all cases.

    points, normals: (n, k, 3), unit normals out of the grain; missing contacts at the end are NaN
    force, torque: (n, 3), force of the flow, and its torque about the centre of mass
    weight, centre: (n, 3), all other forces, which act at the centre of mass, and that centre
    law: contact law, or coefficients of friction, one or (n,)
    mass: (n,), inertia: (n, 3, 3) about the centre; NaN if unknown
    areas: (n, k), as in `Contacts`, zero at points
    """

    points: Floats
    normals: Floats
    force: Floats
    torque: Floats
    weight: Floats
    centre: Floats
    law: FrictionCone
    mass: Floats = field(default_factory=lambda: np.array(np.nan))
    inertia: Floats = field(default_factory=lambda: np.full((3, 3), np.nan))
    areas: Floats | None = None

    def __post_init__(self) -> None:
        contacts = np.shape(self.points)[-2:]
        shapes = {"points": contacts, "normals": contacts, "mass": (), "inertia": (3, 3)}
        shapes["areas"] = contacts[:1]
        for item in fields(self):
            value, inner = getattr(self, item.name), shapes.get(item.name, (3,))
            value = 0.0 if value is None else value
            if item.name == "law" and not isinstance(value, FrictionCone):
                value = FrictionCone(np.asarray(value, dtype=float))
            rows: Any
            try:
                if isinstance(value, FrictionCone):
                    rows = value.rows(len(self))
                else:
                    rows = np.broadcast_to(np.asarray(value, dtype=float), (len(self), *inner))
            except ValueError:
                raise SceneError(
                    f"cases: {item.name} does not fit {len(self)} cases; "
                    "give a row for each, or one for all"
                ) from None
            object.__setattr__(self, item.name, rows)

    def __len__(self) -> int:
        return len(self.force)

    def part(self, rows: Rows) -> Cases:
        """Select cases."""
        return Cases(**{item.name: getattr(self, item.name)[rows] for item in fields(self)})

    @property
    def contacts(self) -> Integers:
        """Number of contacts (n,)."""
        there = ~np.isnan(np.concatenate([self.points, self.normals], axis=2)).all(axis=2)
        return np.asarray((there * np.arange(1, there.shape[1] + 1)).max(axis=1, initial=0))

    def case(self, number: int) -> tuple[Load, Contacts, FrictionCone, MassAndInertia | None]:
        """Arguments of `judged` for a single case; raises SceneError."""
        acting = [getattr(self, name)[number] for name in ("force", "torque", "weight", "centre")]
        count = int(self.contacts[number])
        surface = self.points, self.normals, np.asarray(self.areas)
        contacts = Contacts(*(table[number, :count] for table in surface))
        mass, inertia = float(self.mass[number]), self.inertia[number]
        known = None if np.isnan(mass) and np.isnan(inertia).all() else (mass, inertia)
        return Load(*acting), contacts, self.law[number], known


@dataclass(frozen=True, eq=False)
class Batch:
    """Verdicts of the exact criterion on n cases."""

    factors: Floats  # (n,) safety factors; NaN if a case fails
    held: Booleans  # (n,) whether the actual load is balanced
    modes: Integers  # (n,) indices in `labels`, those of `Exact.label`; FAILED if a case fails
    labels: tuple[str, ...]
    alone: int  # number of cases evaluated one by one
    reasons: dict[int, str]  # reasons of failure, by case

    @property
    def mode_names(self) -> list[str]:
        """Modes in words, "" if a case fails."""
        return ["" if mode == FAILED else self.labels[mode] for mode in self.modes.tolist()]

    def complete(self) -> Batch:
        """Return the batch; raises SceneError with the first reason if a case fails."""
        if self.reasons:
            raise SceneError(next(iter(self.reasons.values())))
        return self


def judge_many(cases: Cases) -> Batch:
    """Evaluate a batch of contact problems by the exact criterion.

    An invalid case fails with its reason. Safety factors equal those of `safety_factor`, in 2-D to round-off, in
    3-D to 1e-9.
    """
    count = len(cases)
    factors, held = np.full(count, np.nan), np.zeros(count, dtype=bool)
    modes, reasons = np.full(count, FAILED), dict[int, str]()
    with unwarned():
        for start in range(0, count, CHUNK):
            for places, problem in _groups(cases.part(slice(start, start + CHUNK)), start):
                inert = cases.mass[places], cases.inertia[places]
                with suppress(ArithmeticError, ValueError):  # numbers of extreme size
                    factors[places], held[places], modes[places] = _together(problem, *inert)
        alone = np.flatnonzero(modes == FAILED)
        for place in alone.tolist():
            factors[place], held[place] = np.nan, False
            try:
                exact = judged(*cases.case(place))
            except (SceneError, ConvergenceError) as error:
                reasons[place] = str(error)
            except Exception as error:  # likewise; a failing case must not end the others
                why = shortened(error) or type(error).__name__
                reasons[place] = f"cannot be judged ({why}); give numbers of similar magnitude"
            else:
                factors[place], held[place] = exact.safety.value, not exact.moves
                modes[place] = LABELS.index(exact.label)
    return Batch(factors, held, modes, LABELS, len(alone), reasons)


def _groups(cases: Cases, start: int) -> Iterator[tuple[Integers, ContactProblem]]:
    counts = cases.contacts
    for count in np.unique(counts[counts > 0]).tolist():
        places = np.flatnonzero(counts == count)
        some = cases.part(places)
        arms = some.points[:, :count] - some.centre[:, None]
        normals = some.normals[:, :count]
        usual = _usual(some, arms, normals)
        places, some, arms = places[usual], some.part(usual), arms[usual]
        if len(places) == 0:
            continue
        normals = normals[usual] / np.linalg.norm(normals[usual], axis=2)[:, :, None]
        loads = np.zeros((len(places), 2, 6))
        loads[:, 0, :3], loads[:, 0, 3:], loads[:, 1, :3] = some.force, some.torque, some.weight
        problem = ContactProblem.of_rows(
            arms, normals, loads, some.law, np.asarray(some.areas)[:, :count]
        )
        axes, planar = problem.planes(some.inertia)
        for rows, axis in ((planar, axes[planar]), (~planar, None)):
            if rows.any():
                yield start + places[rows], replace(problem.part(rows), normal_axis=axis)


def _usual(cases: Cases, arms: Floats, normals: Floats) -> Booleans:
    reach = np.linalg.norm(arms, axis=2).max(axis=1)
    acting = cases.force + cases.torque + cases.weight
    faults = np.any([*inertia_faults(cases.mass, cases.inertia).values()], axis=0)
    unknown = np.isnan(cases.mass) & np.isnan(cases.inertia).all(axis=(1, 2))
    rules = (
        np.isfinite(acting.sum(axis=1) + reach) & (reach > 0.0),
        (np.abs(np.linalg.norm(normals, axis=2) - 1.0) <= UNIT_TOLERANCE).all(axis=1),
        cases.law.is_usual,
        ((arms * normals).sum(axis=2) >= 0.0).any(axis=1),
        unknown | ~faults,
    )
    return np.asarray(np.all(rules, axis=0))


def _together(
    problem: ContactProblem, mass: Floats, inertia: Floats
) -> tuple[Floats, Booleans, Integers]:
    balanced = intervals(problem)
    held, answered = balanced.held, balanced.state != UNANSWERED
    modes = np.where(answered, np.where(held, 0, 1), FAILED)
    moving = np.flatnonzero(~held & answered & np.isfinite(mass))
    if len(moving):
        part, mass = problem.part(moving), mass[moving]
        released = ReleaseProblem.of(part, inverses(mass, inertia[moving], part.reach), mass)
        count, accelerations, _ = released.motions(4)  # at most, those of least energy
        kinds = released.classified(accelerations[:, 0, :-1])[3]
        modes[moving] = np.where((count > 0) & (kinds > 0), kinds + 1, FAILED)
    return np.where(balanced.state == HELD, balanced.high, 0.0), held, modes
