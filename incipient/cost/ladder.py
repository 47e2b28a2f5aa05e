"""The runs of a study of cost: orders, cell sizes, time steps and solver options around those of a scene."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from ..errors import SceneError
from ..planning.flow_setup import order_of
from ..scene import Scene
from .measurement import Variant
from .solvers import SolverOptions

RATIO = math.sqrt(2.0)  # of cell sizes from one variant to the next
UNEQUAL = 1.02  # ratios that differ by more are not the same
SMALLEST, LARGEST = 0.01, 100.0  # of numerics.mesh_size
COMPARED = (
    3  # variants on which solver options are compared: so many tell how error and time go together
)


@dataclass(frozen=True)
class Ladder:
    """The runs to compare, the cheapest of each order first, and the finer one they are compared with.

    line:  runs of the reference's order, each finer than the one before, the reference last
    cheap: the coarsest variants of the middle order, on which solver options are compared
    """

    variants: tuple[Variant, ...]
    reference: Variant
    line: tuple[Variant, ...]
    cheap: tuple[Variant, ...]

    @property
    def compared(self) -> tuple[Variant, ...]:
        """The variants that are solved with other options as well."""
        found = (replace(variant, solver="") for variant in self.variants if variant.solver)
        return tuple(dict.fromkeys(found))

    @property
    def ratio(self) -> float:
        """The ratio of the cells (or else steps) of the last three runs of the line; NaN where it is not constant."""
        last = self.line[-3:]
        sizes = _ratios([variant.mesh_size for variant in last])
        steps = _ratios([variant.step or 1.0 for variant in last])
        if any(max(ratios) > UNEQUAL * min(ratios) for ratios in (sizes, steps)):
            return math.nan
        return max(sizes) if max(sizes) > UNEQUAL else max(steps)


@dataclass(frozen=True)
class Spread:
    """Orders of the velocity; cell sizes and time steps as multiples of the scene's, the coarsest first.

    solvers: solver options besides the scene's own, on every variant; None: the usual ones, on a few cheap variants
    """

    orders: tuple[int, ...] = (2, 3, 4)
    sizes: tuple[float, ...] = (2.0, RATIO, 1.0, 1.0 / RATIO, 0.5)
    steps: tuple[float, ...] = (4.0, 2.0, 1.0)
    solvers: tuple[str, ...] | None = None

    def __post_init__(self) -> None:
        for name, values in (("orders", self.orders), ("sizes", self.sizes), ("steps", self.steps)):
            if not values or min(values) <= 0.0:
                raise SceneError(f"--{name}: give positive numbers, such as {_EXAMPLES[name]}")
        if not set(self.orders) <= {2, 3, 4}:
            raise SceneError("--orders: the velocity has order 2, 3 or 4")


_EXAMPLES = {"orders": "2 3", "sizes": "2 1.4 1", "steps": "4 2 1"}
STEADY, UNSTEADY = Spread(), Spread(sizes=(2.0, RATIO, 1.0))
QUICK = Spread((2, 3), (2.0, RATIO), (4.0, 2.0), solvers=())
# In space higher orders and finer cells soon have too many unknowns, and few solver options have a meaning.
IN_SPACE = Spread((2,), (2.0, RATIO, 1.0), (4.0, 2.0, 1.0), solvers=())
# With wall layers k and epsilon have one order, and no other solver option is known to matter.
WITH_WALL_LAYERS = Spread((2, 3), (2.0, RATIO, 1.0, 1.0 / RATIO), (4.0, 2.0, 1.0), solvers=())


def spread(scene: Scene, quick: bool) -> Spread:
    """The usual ladder of a scene."""
    if scene.gdim == 3 or scene.is_averaged:
        usual = WITH_WALL_LAYERS if scene.gdim == 2 else IN_SPACE
        if quick:
            usual = replace(usual, sizes=usual.sizes[:-1], steps=usual.steps[:-1])
        return (
            replace(usual, orders=(order_of(scene).number,)) if quick or scene.gdim == 3 else usual
        )
    if quick:
        return replace(QUICK, orders=(3, 4)) if order_of(scene).number == 4 else QUICK
    return STEADY if scene.time is None else UNSTEADY


def ladder(scene: Scene, spread: Spread) -> Ladder:
    """All variants of a spread that the scene can be computed with; the reference is finer than all of them.

    Variants to be compared stand together, so that their times are taken one soon after the other. Raises SceneError.
    """
    plain = _solved_as_is(scene, spread)
    at, ways = plain.variants, SolverOptions(scene).named(spread.solvers or ())
    if spread.solvers is None:
        at = plain.cheap
        ways = tuple(
            dict.fromkeys(way for variant in at for way in SolverOptions(variant.of(scene)).usual)
        )
    found: list[Variant] = []
    for variant in plain.variants:
        # What "auto" decides may hang on the cells.
        others = [
            way for way in ways if variant in at and SolverOptions(variant.of(scene)).differs(way)
        ]
        found += [variant, *(replace(variant, solver=way) for way in others)]
    return replace(plain, variants=tuple(found))


def _solved_as_is(scene: Scene, spread: Spread) -> Ladder:
    orders, finest = tuple(sorted(set(spread.orders))), scene.numerics.mesh_size
    sizes = _descending(finest * size for size in spread.sizes)
    sizes = tuple(size for size in sizes if SMALLEST <= size <= LARGEST) or (finest,)
    if scene.time is not None:
        steps = _descending(
            min(scene.time.step * step, scene.time.end / 2.0) for step in spread.steps
        )
        return _unsteady(orders, sizes, steps)
    finer = 2.0 if scene.gdim == 2 else RATIO
    if scene.is_averaged:
        return _steady(orders, sizes, orders[-1], finer)
    # A higher order is worth more than finer cells; without one they must be finer, too.
    return _steady(orders, sizes, min(orders[-1] + 1, 4), RATIO if orders[-1] == 4 else finer)


def _steady(orders: Sequence[int], sizes: Sequence[float], highest: int, finer: float) -> Ladder:
    """All orders on all cells; the reference of the highest order has cells `finer` times as small."""
    variants = tuple(Variant(order, size) for order in orders for size in sizes)
    reference = Variant(highest, max(sizes[-1] / finer, SMALLEST))
    line = tuple(variant for variant in variants if variant.order == highest)
    return Ladder(variants, reference, (*line, reference), _cheap(variants, orders))


def _unsteady(orders: Sequence[int], sizes: Sequence[float], steps: Sequence[float]) -> Ladder:
    """Cells and steps finer together, and each a little behind the other."""
    both = max(len(sizes), len(steps))
    sizes, steps = ([*values, *[values[-1]] * (both - len(values))] for values in (sizes, steps))
    rungs = list(zip(sizes, steps, strict=True))
    pairs = rungs[:1]
    for (_, before), (size, step) in itertools.pairwise(rungs):
        pairs += [(size, before), (size, step)]
    variants = tuple(Variant(order, *pair) for order in orders for pair in dict.fromkeys(pairs))
    reference = Variant(orders[-1], max(sizes[-1] / RATIO, SMALLEST), steps[-1] / 2.0)
    diagonal = [Variant(orders[-1], *pair) for pair in rungs]
    return Ladder(
        variants, reference, (*dict.fromkeys(diagonal), reference), _cheap(variants, orders)
    )


def _cheap(variants: Sequence[Variant], orders: Sequence[int]) -> tuple[Variant, ...]:
    """The coarsest variants of the middle order; of an even number of orders the lower of the two in the middle."""
    order = orders[(len(orders) - 1) // 2]
    return tuple(variant for variant in variants if variant.order == order)[:COMPARED]


def _descending(values: Iterable[float]) -> tuple[float, ...]:
    return tuple(sorted(set(values), reverse=True))


def _ratios(values: Sequence[float]) -> list[float]:
    """Ratios of neighbours; 1 for a single value."""
    return [before / now for before, now in itertools.pairwise(values)] or [1.0]
