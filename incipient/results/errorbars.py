"""Error bars on force, couple and path: their terms, as data."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import Floats
from ..geometry.placement import Placement
from .loads import loads_words
from .safetybar import SafetyBar

if TYPE_CHECKING:
    from .result import Result


@dataclass(frozen=True)
class Loads:
    """Force and couple (3,) of the flow on a grain, and of one that moves place, and angle or quaternion (3 or 7,)."""

    force: Floats
    couple: Floats
    place: Floats | None = None

    @classmethod
    def of(cls, result: Result) -> Loads:
        """The loads, and the place, at the end of a run with a grain."""
        assert result.force is not None and result.couple is not None
        place = None
        if result.trajectory is not None:
            path = result.trajectory
            turned = path["quaternion"] if "quaternion" in path else [path["angle"]]
            place = np.array([*path["place"], *turned])
        return cls(result.force.flow, result.couple.flow, place)


@dataclass(frozen=True)
class Term:
    """One source of error: absolute errors of force and couple (3,), of place and turn of a moving grain, how found.

    place: (3,), in space (6,), the turn in radians, in space about x, y and z

    power: exponent of the gap with which its error is expected to fall
    parts: terms that this one is the sum of, if any
    """

    name: str
    force: Floats
    couple: Floats
    how: str
    place: Floats | None = None
    power: float = 1.0
    parts: tuple[Term, ...] = ()

    @classmethod
    def of_parts(cls, name: str, parts: tuple[Term, ...], how: str) -> Term:
        """The sum of terms."""
        force, couple = (np.sum([getattr(part, of) for part in parts], axis=0) for of in ("force", "couple"))
        places = [part.place for part in parts if part.place is not None]
        return cls(name, force, couple, how, np.sum(places, axis=0) if places else None, parts=parts)

    @classmethod
    def of_difference(cls, name: str, one: Loads, other: Loads, share: float, how: str) -> Term:
        """The error that is a share of what two runs differ by."""
        place = None
        if one.place is not None and other.place is not None:
            place = share * np.abs(way(one.place, other.place))
        force, couple = np.abs(one.force - other.force), np.abs(one.couple - other.couple)
        return cls(name, share * force, share * couple, how, place)


@dataclass(frozen=True)
class ErrorBars:
    """The error terms of a run, and what they mean for the verdict.

    left_out: terms that do not apply or are not estimated, with the reason
    failed:   terms that should be there, with what kept them from being computed
    """

    terms: tuple[Term, ...]
    left_out: dict[str, str] = field(default_factory=dict)
    failed: dict[str, str] = field(default_factory=dict)
    safety: SafetyBar | None = None

    @property
    def force(self) -> Floats:
        """(3,) absolute error of the force."""
        return np.sum([term.force for term in self.terms], axis=0) if self.terms else np.full(3, np.nan)

    @property
    def couple(self) -> Floats:
        """(3,) absolute error of the couple."""
        return np.sum([term.couple for term in self.terms], axis=0) if self.terms else np.full(3, np.nan)

    @property
    def place(self) -> Floats | None:
        """(3,), in space (6,), absolute error of place and turn of a moving grain at the end of its path."""
        places = [term.place for term in self.terms if term.place is not None]
        return np.sum(places, axis=0) if places else None

    def to_dict(self) -> dict[str, Any]:
        """Plain data for result.json."""
        return {
            "force": self.force,
            "couple": self.couple,
            "place": self.place,
            "terms": [asdict(term) for term in self.terms],
            "left_out": self.left_out,
            "failed": self.failed,
            "safety_factor": None if self.safety is None else asdict(self.safety),
        }

    def lines(self, gdim: int = 2) -> list[str]:
        """Errors and where they come from, for a reader, of a scene of a dimension."""
        whole = loads_words(self.force, self.couple, gdim, ".1e")
        lines = [f"error bars          {whole}{_end_of_path(self.place)}"]
        for term in self.terms:
            lines.append(f"  {term.name:<18}{_errors(term, gdim)}   {term.how}")
            lines += [f"    {part.name:<16}{_errors(part, gdim)}   {part.how}" for part in term.parts]
        lines += [f"  {name:<18}{why}" for name, why in self.left_out.items()]
        return lines + [f"  {name:<18}not computed: {why}" for name, why in self.failed.items()]


def _errors(term: Term, gdim: int) -> str:
    return f"{loads_words(term.force, term.couple, gdim, '.1e')}{_end_of_path(term.place)}"


def _end_of_path(place: Floats | None) -> str:
    if place is None:
        return ""
    gdim = 2 if len(place) == 3 else 3
    return "   end of the path {}, turn {} rad".format(
        *(
            f"({', '.join(f'{x:.1e}' for x in part)})" if len(part) > 1 else f"{part[0]:.1e}"
            for part in (place[:gdim], place[gdim:])
        )
    )


def way(first: Floats, second: Floats) -> Floats:
    """Way and turn (3,), in space (6,), between two places with an angle (3,) or a quaternion (7,)."""
    if len(first) == 3:
        return second - first
    one, other = (Placement(tuple(x[:3]), quaternion=tuple(x[3:])) for x in (first, second))
    return np.concatenate([second[:3] - first[:3], other.turn_since(one)])
