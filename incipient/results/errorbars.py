"""Error bars of a run: terms, as data."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import Floats
from ..geometry.placement import Placement
from .loads import Elevations, Forces, Torques, loads_words
from .quantity import STORED_NAMES, as_stored

if TYPE_CHECKING:
    from ..contact.robustness import Interval
    from ..mesh.sampling import Extremum
    from .wall_report import WallReport

# Force and torque without a grain.
NO_GRAIN: Floats = np.zeros(0)
ALL = "the sum: an error bar is not a standard deviation"
# Quantities of a term's errors, with their labels.
ERRORS = {
    "force": "force",
    "torque": "torque",
    "place": "end of the path with rotation [rad]",
    "elevation": "elevation",
    "level": "elevation at the end",
    "shear": "u*",
    "separated": "x of separation",
    "centreline": "velocity on the centrelines",
}


@dataclass(frozen=True)
class Loads:
    """Force and torque (3,) of the flow on a grain, and the other quantities with error estimates."""

    # force, torque: (0,) without a grain
    force: Floats
    torque: Floats
    place: Floats | None = None  # position of a moving grain with angle or quaternion: (3 or 7,)
    elevations: Elevations | None = None  # of a free surface
    # (2,) u* at the outflow and its mean along walls with a wall-function layer, without a grain
    shear: Floats | None = None
    # (n, 2) x of separation and reattachment along the bed, the longest interval first
    separated: Floats | None = None
    # (3,) extreme velocities on the centrelines of a lid-driven box without a grain
    centreline: Floats | None = None
    moved: bool = False  # whether their own error does not add to that of their change
    # (6,) changes of force and torque in the last steps of a flow that is not converged
    unsteady: Floats = field(default_factory=lambda: np.zeros(6))

    @classmethod
    def at_the_end(
        cls,
        force: Forces | None,
        torque: Torques | None,
        place: Floats | None,
        elevations: Elevations | None,
        walls: WallReport | None = None,
        size: float = 1.0,
        upstream: Sequence[Sequence[float]] | None = None,
    ) -> Loads:
        """Build from the results at the end; u* at walls without a grain alone.

        upstream: intervals of x of reverse laminar flow along the bed
        """
        of_force, of_torque = (NO_GRAIN if one is None else one.plain for one in (force, torque))
        shear = None if walls is None or force is not None else walls.shear_velocities
        upstream = upstream if walls is None else walls.backward
        separated = None if upstream is None else longest_first(upstream)
        loads = cls(of_force, of_torque, place, elevations, shear, separated)
        spread = 0.0 if walls is None or force is None else walls.spread
        return replace(loads, unsteady=loads.part(spread, size)) if spread else loads

    def apart(self, other: Loads) -> dict[str, Floats | None]:
        """Absolute differences by quantity; None of a quantity that is not known of both."""
        number, still = len(self.force), self.unsteady + other.unsteady
        force = np.abs(self.force - other.force) + still[:number]
        torque = np.abs(self.torque - other.torque) + still[3 : 3 + number]
        separated = None
        if self.separated is not None and len(self.separated):
            separated = _apart(self.separated[0], other.separated)
        levels = self.elevations, other.elevations
        return {
            "force": force,
            "torque": torque,
            "place": _of_both(lambda a, b: np.abs(way(a, b)), self.place, other.place),
            "elevation": _of_both(Elevations.apart, *levels),
            "level": _of_both(Elevations.apart_at_the_end, *levels),
            "shear": _of_both(lambda a, b: np.abs(a - b), self.shear, other.shear),
            "separated": separated,
            # A single value may agree on two meshes by chance.
            "centreline": _of_both(
                lambda a, b: np.full(len(a), np.abs(a - b).max()), self.centreline, other.centreline
            ),
        }

    def where_separates(self, other: Loads) -> Loads:
        """The loads with the interval of reverse flow first that overlaps most with the other's longest."""
        mine, theirs = self.separated, other.separated
        if mine is None or theirs is None or not len(mine) or not len(theirs):
            return self
        shared = _shared(theirs[0], mine)
        return replace(self, separated=mine[np.argsort(-shared, kind="stable")])

    def part(self, share: float, size: float) -> Floats:
        """A fraction of the loads (6,) on a grain of a size, in components that symmetry admits."""
        whole = float(np.linalg.norm([*self.force, *(self.torque / size)]))
        units = np.repeat([1.0, size], 3)
        return np.asarray(
            share * whole * units * (np.concatenate([self.force, self.torque]) != 0.0)
        )


@dataclass(frozen=True)
class Correction:
    """Correction of the computed force and torque (3,) for errors of known sign."""

    force: Floats
    torque: Floats


@dataclass(frozen=True)
class Term:
    """One source of error: absolute errors of force, torque (3,) and other quantities, and how they are estimated.

    force, torque: remaining errors after a correction; (0,) without a grain
    place: (3,), in 3-D (6,), of position and rotation [rad] of a moving grain
    power: exponent of the gap in the error; parts: terms whose sum this term is
    elevation, level: (stations,) of a free surface: largest error within the run, and error at the end
    shear, separated, centreline: as in `Loads`
    doubt: why the errors may be more than twice as large, or empty
    """

    name: str
    force: Floats
    torque: Floats
    how: str
    place: Floats | None = None
    power: float = 1.0
    parts: tuple[Term, ...] = ()
    elevation: Floats | None = None
    level: Floats | None = None
    shear: Floats | None = None
    separated: Floats | None = None
    centreline: Floats | None = None
    doubt: str = ""
    correction: Correction | None = None

    def corrected(self, change: Floats, left: Floats) -> Term:
        """The term with a correction of force, torque, or both, where the estimates agree well enough.

        Args:
            change: (6,) estimated correction of force and torque.
            left: (6,) difference from a second estimate, the remaining error. A component's relative error is at
                least that of its vector.
        """
        added, errors = np.zeros(6), np.concatenate([self.force, self.torque])
        for part in (slice(3), slice(3, 6)):
            size, doubt = (float(np.linalg.norm(one[part])) for one in (change, left))
            if doubt < size:
                added[part] = change[part]
                errors[part] = np.maximum(np.abs(left[part]), doubt / size * np.abs(change[part]))
            else:
                errors[part] = np.maximum(errors[part], np.abs(left[part]))
        if not added.any():
            return replace(self, force=errors[:3], torque=errors[3:])
        correction = Correction(added[:3], added[3:])
        return replace(self, force=errors[:3], torque=errors[3:], correction=correction)

    @property
    def uncorrected(self) -> Term:
        if self.correction is None:
            return self
        pairs = (self.correction.force, self.force), (self.correction.torque, self.torque)
        force, torque = (np.maximum(np.abs(change), left) for change, left in pairs)
        return replace(self, force=force, torque=torque, correction=None)

    @classmethod
    def of_parts(cls, name: str, parts: tuple[Term, ...], how: str) -> Term:
        if not parts:
            return cls(name, np.full(3, np.nan), np.full(3, np.nan), how)
        return cls(name, how=how, parts=parts, **{of: _sum_of(parts, of) for of in ERRORS})  # type: ignore[arg-type]

    @classmethod
    def of_difference(cls, name: str, one: Loads, other: Loads, share: float, how: str) -> Term:
        apart = one.apart(other).items()
        return cls(name, how=how, **{of: e if e is None else share * e for of, e in apart})  # type: ignore[arg-type]

    def with_components_alike(self) -> Term:
        """The term with errors of nonzero components as large as those of vectors, and equal errors of both u*."""
        force, torque = (
            float(np.linalg.norm(one)) * (one != 0.0) for one in (self.force, self.torque)
        )
        shear = None if self.shear is None else np.full_like(self.shear, np.max(self.shear))
        return replace(self, force=force, torque=torque, shear=shear)

    def with_changes(self, unsteady: Floats) -> Term:
        """The term enlarged by the changes (6,) of the loads of a flow that is not converged."""
        number = len(self.force)
        torque = self.torque + unsteady[3 : 3 + number]
        return replace(self, force=self.force + unsteady[:number], torque=torque)

    def with_elevations_times(self, factor: float) -> Term:
        if self.elevation is None or self.level is None:
            return self
        return replace(self, elevation=factor * self.elevation, level=factor * self.level)

    def at_least(self, other: Term) -> Term:
        pairs = {name: (getattr(self, name), getattr(other, name)) for name in ERRORS}
        known = {n: (a, b) for n, (a, b) in pairs.items() if a is not None and b is not None}
        return replace(self, **{n: np.maximum(a, b) for n, (a, b) in known.items()})


@dataclass(frozen=True)
class SafetyBar:
    """Safety factor over all loads within the error bars, its certainty, and the decisive error."""

    value: float
    # low, high: smallest and largest safety factor of a load within the bars
    low: float
    high: float
    # Whether rest under all of these loads, or motion under all, is proved; with wall layers only within the range of
    # the law of the wall
    certain: bool
    # "rest" alone if all loads within the bars rest, otherwise the modes of the loads examined
    modes: tuple[str, ...]
    decisive: str  # the term whose removal shrinks the range of safety factors most
    # some, every: smallest and largest multiple of the flow's load that the contacts balance for some load within the
    # bars, and for all of them; None without one
    some: Interval | None
    every: Interval | None
    # Terms whose estimate failed, and the model of the mean flow
    unknown: tuple[str, ...] = ()
    # Relative change of the load of the flow as the grain rocks, which sets low and high; nothing is then proved.
    # None: the grain does not rock
    frozen: float | None = None

    @property
    def relative(self) -> float:
        """Width of the range over the safety factor, infinite for one infinite end.

        If the weight alone is not held: the relative difference between the ends of `every` and `some`.
        """
        if self.high > 0.0 or self.some is None:
            return _ratio(self.low, self.high, self.value)
        if self.every is None:
            return _ratio(*self.some, self.some[1])
        lower = _ratio(self.some[0], self.every[0], self.every[0])
        return lower + _ratio(self.every[1], self.some[1], self.some[1])

    def to_dict(self) -> dict[str, Any]:
        return asdict(self) | {"sentence": self.sentence()}

    def sentence(self) -> str:
        between = f"safety factor {self.value:.4g}, between {self.low:.4g} and {self.high:.4g}"
        if self.high == 0.0:
            from ..contact.robustness import held_words

            between = f"safety factor 0, {held_words(self.some, self.every)}"
        if self.frozen is not None:
            between = f"safety factor {self.value:.4g}, about {self.low:.4g} to {self.high:.4g}"
            said = "likely, but not proved" if self.low > 1.0 or self.high < 1.0 else "NOT certain"
            return f"{said}: {between}, the flow's load being that in the first pose, off by about {self.frozen:.0%}"
        if not self.certain:
            return f"NOT certain: {between}; to decide, reduce the error of the {self.decisive}"
        if self.unknown:
            names = " and ".join(self.unknown)
            return f"certain but for the error of the {names}, which is not known: {self._outcome()}; {between}"
        return f"certain within the error bars: {self._outcome()}; {between}"

    def _outcome(self) -> str:
        if self.modes == ("rest",):
            return "it rests"
        modes = " or ".join(mode for mode in self.modes if mode != "moves")
        return f"it moves{modes and f' ({modes}, at this load and at the worst within the bars)'}"


def _ratio(low: float, high: float, scale: float) -> float:
    if low >= high:
        return 0.0
    return math.inf if math.isinf(high) or scale == 0.0 else (high - low) / scale


@dataclass(frozen=True)
class ErrorBars:
    """The error terms of a run, and their consequence for the verdict.

    left_out, failed: omitted and failed terms, with the reason
    """

    terms: tuple[Term, ...]
    left_out: dict[str, str] = field(default_factory=dict)
    failed: dict[str, str] = field(default_factory=dict)
    safety: SafetyBar | None = None

    @cached_property
    def total(self) -> Term:
        return Term.of_parts("all", self.terms, ALL)

    @property
    def force(self) -> Floats:
        """Absolute error (3,) of the force, (0,) without a grain."""
        return self.total.force

    @property
    def torque(self) -> Floats:
        """Absolute error (3,) of the torque, (0,) without a grain."""
        return self.total.torque

    @property
    def correction(self) -> Correction | None:
        """Total correction of force and torque (3,), or None."""
        corrections = [term.correction for term in self.terms if term.correction is not None]
        if not corrections:
            return None
        parts = zip(*((one.force, one.torque) for one in corrections), strict=True)
        return Correction(*(np.sum(changes, axis=0) for changes in parts))

    def corrected(self, force: Forces, torque: Torques) -> tuple[Forces, Torques]:
        change = self.correction
        if change is None:
            return force, torque
        return force.corrected(change.force), torque.corrected(change.torque)

    @property
    def doubtful(self) -> str:
        return next((term.name for term in self.terms if term.doubt), "")

    def to_dict(self) -> dict[str, Any]:
        total = as_stored(self.total)
        return {
            **{name: total[name] for name in (STORED_NAMES.get(of, of) for of in ERRORS)},
            "terms": as_stored(self.terms),
            "left_out": self.left_out,
            "failed": self.failed,
            "safety_factor": as_stored(self.safety),
        }

    def lines(self, gdim: int = 2, details: bool = False) -> list[str]:
        """Errors and their sources as text; with details also methods, parts, and omitted terms."""
        lines = [f"error bars          {_errors(self.total, gdim) if self.terms else 'not known'}"]
        for term in self.terms:
            how = f"   {term.how}" if details else ""
            lines.append(f"  {term.name:<18}{_errors(term, gdim)}{how}")
            if details and (change := term.correction) is not None:
                by = loads_words(change.force + 0.0, change.torque + 0.0, gdim, "+.2g")
                lines.append(f"    {'corrected by':<16}{by}")
            if term.doubt:
                why = f"may be more than twice as large: {term.doubt}"
                lines.append(f"    {'not certain':<16}{why}")
            if details:
                lines += [
                    f"    {part.name:<16}{_errors(part, gdim)}   {part.how}" for part in term.parts
                ]
        if details or not self.terms:
            lines += [f"  {name:<18}{why}" for name, why in self.left_out.items()]
        return lines + [f"  {name:<18}not computed: {why}" for name, why in self.failed.items()]


def _of_both(difference: Callable[[Any, Any], Floats], one: Any, other: Any) -> Floats | None:
    return None if one is None or other is None else difference(one, other)


def _sum_of(terms: tuple[Term, ...], name: str) -> Floats | None:
    errors = [error for term in terms if (error := getattr(term, name)) is not None]
    return np.sum(errors, axis=0) if errors else None


def longest_first(spans: Sequence[Sequence[float]]) -> Floats:
    """Intervals (n, 2), the longest first."""
    return np.array(sorted(spans, key=lambda span: span[0] - span[1]), dtype=float).reshape(-1, 2)


def _apart(one: Floats, others: Floats | None) -> Floats:
    """Distance (2,) of an interval's ends from those of the one with the largest overlap, or its length.

    Both ends get the larger distance: one end may agree by chance.
    """
    others = np.empty((0, 2)) if others is None else others
    shared = _shared(one, others)
    if not len(others) or shared.max() <= 0.0:
        return np.full(2, one[1] - one[0])
    return np.full(2, np.abs(one - others[np.argmax(shared)]).max())


def _shared(one: Floats, others: Floats) -> Floats:
    """Overlap (n,) of an interval with each of (n, 2); negative: their distance."""
    return np.asarray(np.minimum(one[1], others[:, 1]) - np.maximum(one[0], others[:, 0]))


def _errors(term: Term, gdim: int) -> str:
    """Errors of a term by label: of loads and positions by component, otherwise the largest."""
    said = [loads_words(term.force, term.torque, gdim, ".1e")] if len(term.force) else []
    for name, label in ERRORS.items():
        errors = None if name in ("force", "torque") else getattr(term, name)
        if errors is not None:
            shown = errors if name == "place" else [errors.max(initial=0.0)]
            said.append(f"{label} {', '.join(f'{error:.1e}' for error in shown)}")
    return "   ".join(said)


def centreline_velocities(extremes: dict[str, Extremum] | None) -> Floats | None:
    """Extreme velocities (3,) on centrelines, or None."""
    return None if extremes is None else np.array([extreme.value for extreme in extremes.values()])


def way(first: Floats, second: Floats) -> Floats:
    """Displacement and rotation (3,), in 3-D (6,), between two positions with an angle (3,) or a quaternion (7,)."""
    if len(first) == 3:
        return second - first
    one, other = (Placement(tuple(x[:3]), quaternion=tuple(x[3:])) for x in (first, second))
    return np.concatenate([second[:3] - first[:3], other.turn_since(one)])
