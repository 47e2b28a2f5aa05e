"""Error bars of a run: terms, as data."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from ..arrays import Floats
from ..files import plain
from ..geometry.placement import Placement
from ..scene.sections import OF_SURFACE
from .loads import Elevations, ForceAndTorque, loads_words

if TYPE_CHECKING:
    from ..contact.robustness import Interval

# Force and torque without a grain.
NO_GRAIN: Floats = np.zeros(0)
UNKNOWN: Floats = np.full(6, np.nan)
ALL = "the sum: an error bar is not a standard deviation"
OF_PATH = ("place", "velocity", "spin")
# Quantities with error estimates, with their labels.
ERRORS = {
    "force": "force",
    "torque": "torque",
    "place": "end of the path with rotation [rad]",
    "velocity": "velocity there",
    "spin": "spin there",
    "elevation": "elevation",
    "level": "elevation at the end",
    "shear_velocity": "u*",
    "separated": "x of separation",
    "centreline": "velocity on the centrelines",
}


def force_and_torque(load: Floats) -> dict[str, Floats]:
    """A load (6,) as stored; nothing without a grain."""
    return {"force": load[:3], "torque": load[3:]} if len(load) else {}


def sizes(load: Floats) -> Floats:
    """Magnitudes (6,) of force and torque of a load (6,), one for each component."""
    return np.repeat(np.linalg.norm(load.reshape(2, -1), axis=1), len(load) // 2)


@dataclass(frozen=True)
class Loads(ForceAndTorque):
    """Force and torque (6,) of the flow on a grain, (0,) without one, and other quantities with error estimates.

    others, by their names in `ERRORS`, where they apply:
        place, velocity, spin: of a moving grain, the place with angle or quaternion (3 or 7,)
        elevation, level: `Elevations` of a free surface, and its stations at the end (stations,)
        shear_velocity: u* at the outflow and its mean along walls with a wall-function layer, without a grain (2,)
        separated: x of separation and reattachment along the bed, the longest interval first (n, 2)
        centreline: extreme velocities on the centrelines of a lid-driven box without a grain (3,)
    """

    load: Floats
    others: Mapping[str, Any] = field(default_factory=dict)
    moved: bool = False  # whether their own error does not add to that of their change
    # (6,) changes of force and torque in the last steps of a flow that is not converged
    unsteady: Floats = field(default_factory=lambda: np.zeros(6))

    def apart(self, other: Loads) -> dict[str, Floats]:
        """Absolute differences of the quantities known of both."""
        still = (self.unsteady + other.unsteady)[: len(self.load)]
        differences = {
            name: np.abs(DIFFERENCES.get(name, np.subtract)(value, other.others[name]))
            for name, value in self.others.items()
            if name in other.others
        }
        known = {name: apart for name, apart in differences.items() if apart.size}
        return {"load": np.abs(self.load - other.load) + still, **known}

    def where_separates(self, other: Loads) -> Loads:
        """The loads with the interval of reverse flow first that overlaps most with the other's longest."""
        mine, theirs = (loads.others.get("separated", ()) for loads in (self, other))
        if not len(mine) or not len(theirs):
            return self
        order = np.argsort(-_shared(theirs[0], mine), kind="stable")
        return replace(self, others={**self.others, "separated": mine[order]})

    def with_spread(self, spread: float, size: float) -> Loads:
        """The loads on a grain of a size in a flow that is not converged, in which they change by a fraction."""
        units = np.repeat([1.0, size], 3)
        whole = np.linalg.norm(self.load / units)
        # Components that vanish because of symmetry do not change.
        return replace(self, unsteady=spread * whole * units * (self.load != 0.0))


@dataclass(frozen=True)
class Term(ForceAndTorque):
    """One source of error: absolute errors of the load (6,) and other quantities, and how they are estimated.

    load: remaining errors of force and torque after a correction; (0,) without a grain
    others: of the other known quantities by their names in `ERRORS`: place (3,), in 3-D (6,), of position and
        rotation [rad]; velocity, spin; elevation, level (stations,): largest error within the run, error at the end
    power: exponent of the gap in the error; parts: terms whose sum this term is
    doubt: why the errors may be more than twice as large, or empty
    correction: (6,) of force and torque, for errors of known sign
    """

    name: str
    load: Floats
    how: str
    others: Mapping[str, Floats] = field(default_factory=dict)
    power: float = 1.0
    parts: tuple[Term, ...] = ()
    doubt: str = ""
    correction: Floats | None = None

    @property
    def errors(self) -> dict[str, Floats]:
        return {"load": self.load, **self.others}

    def with_errors(self, changed: Mapping[str, Floats]) -> Term:
        errors = self.errors | {**changed}
        return replace(self, load=errors.pop("load"), others=errors)

    def corrected(self, change: Floats, left: Floats) -> Term:
        """The term with a correction of force, torque, or both, where the estimates agree well enough.

        Args:
            change: (6,) estimated correction of force and torque.
            left: (6,) difference from a second estimate, the remaining error. A component's relative error is at
                least that of its vector.
        """
        size, doubt = sizes(change), sizes(left)
        agrees = doubt < size
        relative = np.divide(doubt, size, out=np.zeros(6), where=agrees)
        least = np.where(agrees, relative * np.abs(change), self.load)
        correction = np.where(agrees, change, 0.0) if agrees.any() else None
        return replace(self, load=np.maximum(np.abs(left), least), correction=correction)

    @property
    def uncorrected(self) -> Term:
        if self.correction is None:
            return self
        whole = np.maximum(np.abs(self.correction), self.load)
        return replace(self, load=whole, correction=None)

    @classmethod
    def of_parts(cls, name: str, parts: tuple[Term, ...], how: str) -> Term:
        """The sum of terms; unknown (NaN) without any."""
        sums: dict[str, Floats] = {}
        for part in parts:
            for quantity, error in part.errors.items():
                sums[quantity] = sums.get(quantity, 0.0) + error
        return cls(name, UNKNOWN, how, parts=parts).with_errors(sums)

    @classmethod
    def of_difference(cls, name: str, loads: Loads, other: Loads, share: float, how: str) -> Term:
        errors = {quantity: share * apart for quantity, apart in loads.apart(other).items()}
        return cls(name, UNKNOWN, how).with_errors(errors)

    def with_components_alike(self) -> Term:
        """The term with errors of nonzero components as large as those of vectors, and equal errors of both u*."""
        alike = {"load": sizes(self.load) * (self.load != 0.0)}
        if (shear := self.others.get("shear_velocity")) is not None:
            alike["shear_velocity"] = np.full_like(shear, shear.max())
        return self.with_errors(alike)

    def with_changes(self, unsteady: Floats) -> Term:
        """The term enlarged by the changes (6,) of the loads of a flow that is not converged."""
        return replace(self, load=self.load + unsteady[: len(self.load)])

    def with_elevations_times(self, factor: float) -> Term:
        scaled = {name: factor * e for name, e in self.others.items() if name in OF_SURFACE}
        return self.with_errors(scaled)

    def at_least(self, other: Term) -> Term:
        other_errors = other.errors
        return self.with_errors(
            {name: np.maximum(e, other_errors.get(name, e)) for name, e in self.errors.items()}
        )

    def to_dict(self) -> dict[str, Any]:
        """All quantities by their names in `ERRORS`, None where unknown, and how they are estimated."""
        about = ("name", "how", "power", "parts", "doubt")
        stored = {
            **dict.fromkeys(ERRORS),
            **force_and_torque(self.load),
            **self.others,
            **{key: getattr(self, key) for key in about},
            "correction": None if self.correction is None else force_and_torque(self.correction),
        }
        return {key: plain(value) for key, value in stored.items()}


@dataclass(frozen=True)
class SafetyBar:
    """Safety factor over all loads within the error bars, its certainty, and the decisive error."""

    derived: ClassVar = ("sentence",)
    value: float
    # low, high: smallest and largest safety factor of a load within the bars
    low: float
    high: float
    # Whether rest under all of these loads, or motion under all, is proved; with wall layers only within the range of
    # the law of the wall
    certain: bool
    rests: bool  # whether all loads within the bars rest
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

    @property
    def sentence(self) -> str:
        outcome = "it rests" if self.rests else "it moves"
        between = f"safety factor {self.value:.4g}, between {self.low:.4g} and {self.high:.4g}"
        if self.high == 0.0:
            from ..contact.robustness import held_words

            between = f"safety factor 0, {held_words(self.some, self.every)}"
        if math.isinf(self.low):
            between = "safety factor infinite"
        if self.frozen is not None:
            between = f"safety factor {self.value:.4g}, about {self.low:.4g} to {self.high:.4g}"
            said = "likely, but not proved" if self.low > 1.0 or self.high < 1.0 else "NOT certain"
            return f"{said}: {between}, the flow's load being that in the first pose, off by about {self.frozen:.0%}"
        if not self.certain:
            return f"NOT certain: {between}; to decide, reduce the error of the {self.decisive}"
        if self.unknown:
            names = " and ".join(self.unknown)
            return f"certain but for the error of the {names}, which is not known: {outcome}; {between}"
        return f"certain within the error bars: {outcome}; {between}"


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
    def correction(self) -> Floats | None:
        """Total correction (6,), or None."""
        corrections = [term.correction for term in self.terms if term.correction is not None]
        return np.sum(corrections, axis=0) if corrections else None

    def to_dict(self) -> dict[str, Any]:
        total = self.total.to_dict()
        return {
            **{name: total[name] for name in ERRORS},
            "terms": plain(self.terms),
            "left_out": self.left_out,
            "failed": self.failed,
            "safety_factor": plain(self.safety),
        }

    def lines(self, gdim: int = 2, details: bool = False) -> list[str]:
        """Errors and their sources as text; with details also methods, parts, and omitted terms."""
        lines = [f"error bars          {_errors(self.total, gdim) if self.terms else 'not known'}"]
        for term in self.terms:
            how = f"   {term.how}" if details else ""
            lines.append(f"  {term.name:<18}{_errors(term, gdim)}{how}")
            if details and (change := term.correction) is not None:
                by = loads_words(change[:3] + 0.0, change[3:] + 0.0, gdim, "+.2g")
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


def _of_separation(spans: Floats, others: Floats) -> Floats:
    """Distance (2,) of the longest interval's ends from those of the one with the largest overlap, or its length.

    Both ends get the larger distance: one end may agree by chance.
    """
    if not len(spans):
        return np.zeros(0)
    start, end = spans[0]
    shared = _shared(spans[0], others)
    if shared.max(initial=0.0) <= 0.0:
        return np.full(2, end - start)
    return np.full(2, np.abs(spans[0] - others[np.argmax(shared)]).max())


def _shared(span: Floats, others: Floats) -> Floats:
    """Overlap (n,) of an interval with each of (n, 2); negative: their distance."""
    return np.asarray(np.minimum(span[1], others[:, 1]) - np.maximum(span[0], others[:, 0]))


def _errors(term: Term, gdim: int) -> str:
    """Errors of a term by label: of loads and positions by component, otherwise the largest."""
    said = [loads_words(term.force, term.torque, gdim, ".1e")] if len(term.force) else []
    for name in [name for name in ERRORS if name in term.others]:
        errors = term.others[name]
        shown = errors if name in OF_PATH else [errors.max(initial=0.0)]
        said.append(f"{ERRORS[name]} {', '.join(f'{error:.1e}' for error in shown)}")
    return "   ".join(said)


def way(first: Floats, second: Floats) -> Floats:
    """Displacement and rotation (3,), in 3-D (6,), between two positions with an angle (3,) or a quaternion (7,)."""
    if len(first) == 3:
        return second - first
    before, after = (Placement(tuple(x[:3]), quaternion=tuple(x[3:])) for x in (first, second))
    return np.concatenate([second[:3] - first[:3], after.turn_since(before)])


# Differences of quantities other than those of their numbers; empty where they mean nothing.
DIFFERENCES: dict[str, Callable[[Any, Any], Floats]] = {
    "place": way,
    "elevation": Elevations.apart,
    "separated": _of_separation,
    # The largest for all: a single value may agree on two meshes by chance.
    "centreline": lambda values, others: np.full(len(values), np.abs(values - others).max()),
}
