"""Where a sweep needs more cases: where the mode changes, and where a quantity bends.

The values given span cells: intervals of one direction, rectangles of two. A cell is halved

- where cases in it or on its edge differ in their mode, until it is no longer than the tolerance;
- where the quantity is not straight: of three neighbours on a line with one mode, f[a, b, c] h^2/4 estimates how far f
  is from the straight line on an interval of length h (f[a, b, c]: second divided difference).

Lengths are shares of the range of each direction, misses shares of the range of the quantity. All cases of a round are
known before the next one is chosen, so that what is chosen hangs on results alone: a sweep that was killed resumes with
the same cases.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from ..errors import SceneError
from .axes import Settings
from .cases import Source, SweepCase
from .lattice import Direction
from .table import quantities

Place = tuple[float, ...]
Resolve = Callable[[Source, Settings], SweepCase]
Results = Callable[[Sequence[str]], Mapping[str, tuple[str, Any]]]

LEAST, USUAL, MOST = 1e-6, 0.02, 1000
_ROUND = 1e-9  # by which a cell may be longer than the tolerance
_ELONGATED = 0.5  # a cell is halved in directions in which it is at least so long as in the longest
_NO_RANGE = 1e-6  # of the largest value: what is constant to that is straight
_USUAL = {
    "threshold": "shields",
    "gust": "strength",
    "entrainment": "probability",
}  # what is to be straight; else the safety factor


@dataclass(frozen=True)
class Aim:
    """Aim of a refinement: the tolerance, the number of cases in all, and the column that is to be straight."""

    tolerance: float = USUAL
    most: int = MOST
    quantity: str | None = None

    def __post_init__(self) -> None:
        if not LEAST <= self.tolerance <= 1.0:
            remedy = f"give a number from {LEAST:g} to 1"
            raise SceneError(f"--refine {self.tolerance:g}: is not a share of the range; {remedy}")
        if self.most < 1:
            raise SceneError(f"--most {self.most}: is not a number of cases; give 1 or more")


@dataclass(frozen=True)
class Seen:
    """Known result of a case: its mode, with whether the quantity is finite, and the quantity."""

    mode: str
    value: float | None


@dataclass(frozen=True)
class Cell:
    """An interval or a rectangle between two places."""

    low: Place
    high: Place

    @classmethod
    def between(cls, ends: Iterable[tuple[float, float]]) -> Cell:
        """The one with these ends along each direction."""
        low, high = zip(*ends, strict=True)
        return cls(low, high)

    def holds(self, place: Place) -> bool:
        """Whether a place is in it or on its edge."""
        return all(a <= x <= b for a, x, b in zip(self.low, place, self.high, strict=True))

    def corners(self) -> Iterator[Place]:
        """All of them."""
        return itertools.product(*zip(self.low, self.high, strict=True))

    def halves(self, ways: Sequence[int]) -> list[Cell]:
        """The cells that halving in some directions makes of it."""
        spans = []
        for way, (low, high) in enumerate(zip(self.low, self.high, strict=True)):
            middle = 0.5 * (low + high)
            spans.append([(low, middle), (middle, high)] if way in ways else [(low, high)])
        return [Cell.between(one) for one in itertools.product(*spans)]


@dataclass(eq=False)
class Family:
    """Cases that share all but one or two directions: their cells, and what is known at places.

    cells: with the modes of the cases in them and on their edges
    cases: by place; None: the scene is refused there
    """

    source: Source
    fixed: Settings
    ways: tuple[Direction, ...]
    cells: dict[Cell, set[str]] = field(default_factory=dict)
    cases: dict[Place, SweepCase | None] = field(default_factory=dict)
    seen: dict[Place, Seen] = field(default_factory=dict)

    def __post_init__(self) -> None:
        numbers = [itertools.pairwise(map(float, range(len(way.along)))) for way in self.ways]
        self.cells = {Cell.between(one): set() for one in itertools.product(*numbers)}

    def given(self) -> Iterator[Place]:
        """The places of the values given."""
        return itertools.product(*(map(float, range(len(way.along))) for way in self.ways))

    def settings(self, place: Place) -> Settings:
        """The overrides at a place."""
        parts = (way.settings(one) for way, one in zip(self.ways, place, strict=True))
        return (*self.fixed, *itertools.chain.from_iterable(parts))

    def lengths(self, cell: Cell) -> list[float]:
        """The lengths of a cell as shares of the ranges."""
        ends = zip(self.ways, cell.low, cell.high, strict=True)
        return [way.at(high) - way.at(low) for way, low, high in ends]

    def see(self, place: Place, found: Seen) -> None:
        """Take what has been found at a place."""
        self.seen[place] = found
        for cell, modes in self.cells.items():
            if cell.holds(place):
                modes.add(found.mode)

    def halve(self, cell: Cell, halves: Sequence[Cell]) -> None:
        """Put halves in the place of a cell."""
        del self.cells[cell]
        for half in halves:
            self.cells[half] = {one.mode for place, one in self.seen.items() if half.holds(place)}

    def bend(self, cell: Cell, way: int, lines: Mapping[tuple[int, Place], list[float]]) -> float:
        """Largest miss of straight lines along the edges of a cell; infinite where it is not known."""
        unknown = Seen("", None)
        worst, known = (
            0.0,
            any(self.seen.get(corner, unknown).value is None for corner in cell.corners()),
        )
        for corner in cell.corners():
            if corner[way] != cell.low[way]:
                continue
            line = lines[way, _without(corner, way)]
            first, last = line.index(cell.low[way]), line.index(cell.high[way])
            for start in range(max(first - 1, 0), min(last, len(line) - 2)):
                miss = self._miss(corner, way, line[start : start + 3], cell)
                known |= miss is not None
                worst = max(worst, miss or 0.0)
        return worst if known else math.inf

    def _miss(self, corner: Place, way: int, three: Sequence[float], cell: Cell) -> float | None:
        """Estimated miss by three neighbours on a line; None if they are not all known and of one mode."""
        seen = [self.seen.get((*corner[:way], one, *corner[way + 1 :])) for one in three]
        values = [one.value for one in seen if one is not None and one.value is not None]
        if len(values) < 3 or len({one.mode for one in seen if one is not None}) > 1:
            return None
        a, b, c = (self.ways[way].at(one) for one in three)
        bent = ((values[2] - values[1]) / (c - b) - (values[1] - values[0]) / (b - a)) / (c - a)
        return abs(bent) * self.lengths(cell)[way] ** 2 / 4.0

    def lines(self) -> dict[tuple[int, Place], list[float]]:
        """The places on each line along each direction, sorted, of cases that are not refused."""
        found: dict[tuple[int, Place], list[float]] = {}
        for place, case in sorted(self.cases.items()):
            for way in range(len(place)) if case is not None else ():
                found.setdefault((way, _without(place, way)), []).append(place[way])
        return {key: sorted(line) for key, line in found.items()}


def _without(place: Place, way: int) -> Place:
    return (*place[:way], *place[way + 1 :])


@dataclass(frozen=True, order=True)
class _Wanted:
    """A division: the more urgent comes first; modes before bends."""

    urgency: tuple[int, float]
    family: int
    low: Place
    high: Place
    ways: tuple[int, ...]


class SweepRefinement:
    """The refinement of a sweep's families; `following` says which cases come next, `known` are there already.

    `resolve` gives the case that settings make of a source; it raises SceneError.
    """

    def __init__(
        self,
        families: Sequence[Family],
        aim: Aim,
        resolve: Resolve,
        known: Sequence[SweepCase] = (),
    ):
        self._families, self._aim, self._resolve = families, aim, resolve
        self._known = {(case.source, frozenset(case.settings)): case for case in known}
        self._identities: set[str] = set()
        self._refused: list[str] = []
        self._spent = False
        for family in families:
            for place in family.given():
                self._put(family, place)

    @property
    def most(self) -> int:
        """Limit of the number of cases in all."""
        return self._aim.most

    def following(self, results: Results) -> list[SweepCase]:
        """The next cases; none where the aim is reached or the budget is spent.

        `results` gives task and result of those of some cases that are done, by identity. Raises SceneError where no
        case has the quantity.
        """
        self._look(results)
        new: list[SweepCase] = []
        while not new:
            wanted = sorted(self._wanted())
            if not wanted:
                return []
            for one in wanted:
                family, cell = self._families[one.family], Cell(one.low, one.high)
                halves = cell.halves(one.ways)
                places = {
                    place for half in halves for place in half.corners()
                } - family.cases.keys()
                if len(self._identities) + len(places) > self._aim.most:
                    self._spent = True
                    return new
                family.halve(cell, halves)
                new += [
                    case
                    for place in sorted(places)
                    if (case := self._put(family, place)) is not None
                ]
        return new

    def _put(self, family: Family, place: Place) -> SweepCase | None:
        """Take a place into a family; its case if that is a new one."""
        settings = family.settings(place)
        case = self._known.get((family.source.name, frozenset(settings)))
        if case is None:
            try:
                case = self._resolve(family.source, settings)
            except SceneError as error:
                self._refused.append(f"{', '.join(settings)}: {error}")
        family.cases[place] = case
        if case is None or case.identity in self._identities:
            return None
        self._identities.add(case.identity)
        return case

    def _look(self, results: Results) -> None:
        """Take what has been found at places that have not been seen."""
        left = [
            (family, place, case)
            for family in self._families
            for place, case in family.cases.items()
            if case is not None and place not in family.seen
        ]
        found = results([case.identity for _, _, case in left])
        rows = {name: quantities(task, result) for name, (task, result) in found.items()}
        for family, place, case in left:
            if case.identity in rows:
                family.see(place, self._seen(case.task, rows[case.identity]))
        given = self._aim.quantity
        if given is not None and rows and all(given not in row for row in rows.values()):
            there = ", ".join(dict.fromkeys(name for row in rows.values() for name in row))
            raise SceneError(f"--quantity {given}: no case has this column; available: {there}")
        usual = {_USUAL.get(task, "safety_factor") for task, _ in found.values()}
        if (
            given is None
            and rows
            and not any({"mode", *usual} & row.keys() for row in rows.values())
        ):
            there = ", ".join(dict.fromkeys(name for row in rows.values() for name in row))
            raise SceneError(
                f"no case has a mode or {' or '.join(usual)}; give --quantity, available: {there}"
            )

    def _seen(self, task: str, row: Mapping[str, Any]) -> Seen:
        name = self._aim.quantity or _USUAL.get(task, "safety_factor")
        value, mode = row.get(name), str(row.get("mode", "no verdict"))
        if not isinstance(value, int | float) or math.isnan(value):
            return Seen(mode, None)
        if name == "safety_factor":  # from 0 to 1, and straight where the flow is weak
            return Seen(mode, 1.0 if math.isinf(value) else value / (1.0 + value))
        return (
            Seen(mode, float(value))
            if math.isfinite(value)
            else Seen(f"{mode}, without bound", None)
        )

    def _wanted(self) -> Iterator[_Wanted]:
        """The divisions that the aim still needs."""
        limit = self._aim.tolerance * self._span()
        for number, family in enumerate(self._families):
            lines = family.lines()
            for cell, modes in family.cells.items():
                if any(family.cases[corner] is None for corner in cell.corners()):
                    continue
                lengths = family.lengths(cell)
                too_long, longest = self._aim.tolerance * (1.0 + _ROUND), max(lengths)
                halved = [
                    length > too_long and length >= _ELONGATED * longest for length in lengths
                ]
                ways = [way for way, is_long in enumerate(halved) if is_long]
                if not ways:
                    continue
                urgency = (0, -longest)
                if len(modes) < 2:
                    bends = {way: family.bend(cell, way, lines) for way in ways}
                    ways = [way for way in ways if bends[way] > limit]
                    urgency = (1, -max(bends.values()))
                if ways:
                    yield _Wanted(urgency, number, cell.low, cell.high, tuple(ways))

    def _span(self) -> float:
        """The range of the quantity, or what counts as none."""
        seen = (one for family in self._families for one in family.seen.values())
        values = [one.value for one in seen if one.value is not None] or [0.0]
        return max(max(values) - min(values), _NO_RANGE * max(map(abs, values)))

    def lines(self) -> list[str]:
        """Lines for a reader on how well the changes of mode are known."""
        mixed = [
            (family, cell)
            for family in self._families
            for cell in sorted(family.cells, key=lambda one: one.low)
            if len(family.cells[cell]) > 1
        ]
        worst = max((max(family.lengths(cell)) for family, cell in mixed), default=0.0)
        within = (
            f"to {worst:.2g} of the range of each key, in {len(mixed)} cells" if mixed else "none"
        )
        lines = [f"{'changes of mode':<20}{within}"]
        lines += [_between(family, cell) for family, cell in mixed if len(family.ways) == 1]
        if self._spent:
            spent = (
                f"{self._aim.most} cases are spent before the tolerance is reached; raise --most"
            )
            lines.append(f"{'':<20}{spent}")
        if self._refused:
            lines.append(
                f"{'left out':<20}{len(self._refused)} cases between; the first: {self._refused[0]}"
            )
        return lines


def _between(family: Family, cell: Cell) -> str:
    """An interval in which the mode changes."""
    ends = (cell.low, cell.high)
    modes = [family.seen[end].mode if end in family.seen else "not known" for end in ends]
    settings = [", ".join(family.ways[0].settings(end[0])) for end in ends]
    fixed = f" ({', '.join(family.fixed)})" if family.fixed else ""
    return f"  {modes[0]} at {settings[0]}, {modes[1]} at {settings[1]}{fixed}"
