"""Effect of errors of load and friction on the verdict: bounds over a box, and sampled probabilities.

The loads that contacts hold form a convex cone: one conic program tells whether some load
weight + s (flow + directions u), |u_i| <= 1, is held, the corners of the box whether all are.
"""

import itertools
import math
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from incipient.arrays import Floats
from incipient.contact.batch import Cases, judge_many
from incipient.contact.conic import FAILED, TOLERANCE
from incipient.contact.friction import FrictionCone, Law
from incipient.contact.paper import classify
from incipient.contact.problem import ContactProblem, Load
from incipient.contact.safety import Intervals, intervals
from incipient.contact.verdict import MassAndInertia
from incipient.errors import SceneError
from incipient.geometry.contacts import Contacts

Interval = tuple[float, float]
INPUTS = (
    *(f"{name} {axis}" for name in ("flow_force", "flow_couple") for axis in "xyz"),
    "friction",
)
WITHIN = 2.0  # standard errors of every input for which bounds are proved


@dataclass(frozen=True, eq=False)
class SafetyRange:
    """Safety factors possible for some load of a box, and those guaranteed for all."""

    # Smallest and largest factor at which some load of the box, or every load, is held; None without one.
    possible: Interval | None
    guaranteed: Interval | None

    @property
    def low(self) -> float:
        """Smallest safety factor of all loads."""
        return _held_to(self.guaranteed)

    @property
    def high(self) -> float:
        """Largest safety factor of all loads."""
        return _held_to(self.possible)

    @property
    def rests(self) -> bool:
        return _contains(self.guaranteed, 1.0)

    @property
    def moves(self) -> bool:
        return not _contains(self.possible, 1.0)

    @property
    def width(self) -> float:
        """Excess length of `possible` over `guaranteed`, in s / (1 + s)."""
        return _extent(self.possible) - _extent(self.guaranteed)


def safety_range(
    load: Load, contacts: Contacts, law: Law, errors: Floats, of_friction: float = 0.0
) -> SafetyRange:
    """Factors at which some load of a box and every load are held. Raises SceneError as `safety_factor` does.

    `errors` (m, 6) of the flow's force and torque about the centre of mass, times any fraction from -1
    to 1; `of_friction`: largest deviation of the coefficient.
    """
    cone, sides = FrictionCone.of(law), errors[errors.any(axis=1)]
    firm, loose = (
        ContactProblem.of(load, contacts, cone.changed(change), errors=sides)
        for change in (of_friction, -of_friction)
    )
    return SafetyRange(_possible(firm), _guaranteed(loose))


def held_words(some: Interval | None, every: Interval | None) -> str:
    """Describe the multiples of the flow's load that hold a grain whose safety factor is zero."""
    if some is None:
        return "no multiple of the flow's load holds it"
    if some[1] == 0.0:
        return "any fraction of the flow's load moves it"
    may = f"{some[0]:.4g} to {some[1]:.4g} times the flow's load may hold it"
    if every is None:
        return f"{may}, none for certain"
    return f"{may}, {every[0]:.4g} to {every[1]:.4g} times do for certain"


def _possible(problem: ContactProblem) -> Interval | None:
    """Interval of factors at which some load of the box is held.

    s (flow + D u) is s (flow - D 1) + D p with p + q = 2 s 1 and p, q >= 0, like further contact
    forces, over the size of the loads. An unsolved program excludes no load.
    """
    loads = problem.within(problem.wrenches.swapaxes(1, 2))[0]
    flow, weight, ways = loads[:, 0], loads[:, 1], loads[:, 2:]
    size = float(np.linalg.norm(flow) + np.linalg.norm(ways)) or 1.0
    columns, unity = problem.cone_columns[0], np.eye(ways.shape[1])
    beside = np.zeros((len(unity), columns.shape[1]))
    rows = np.block([[ways / size, np.zeros_like(ways), columns], [unity, unity, beside]])
    ends = np.full((2, len(unity)), [[-2.0 * size], [0.0]])
    both = np.concatenate([[flow - ways.sum(axis=1), weight], ends], axis=1)[:, None]
    balanced = Intervals.of(rows[None], both, 2 * len(unity) + problem.linear)
    if balanced.state[0] == FAILED:
        return 0.0, math.inf
    low, high = balanced.low.item(), balanced.high.item()
    if math.isnan(low + high):
        return None
    return low, high if high > TOLERANCE else 0.0


def _guaranteed(problem: ContactProblem) -> Interval | None:
    """Factors at which the load and those at all corners are held."""
    flow, _, *sides = problem.wrenches[0]
    signs = [[0.0] * len(sides), *itertools.product((-1.0, 1.0), repeat=len(sides))]
    every = problem.part(np.zeros(len(signs), dtype=int))
    every.wrenches[:, 0] = flow + np.array(signs) @ np.reshape(sides, (-1, 6))
    low, high, _, _ = intervals(every)
    common = float(low.max()), float(high.min())
    return None if np.isnan(low).any() or common[0] > common[1] else common


def _held_to(interval: Interval | None) -> float:
    return 0.0 if interval is None or interval[0] > 0.0 else interval[1]


def _contains(interval: Interval | None, factor: float) -> bool:
    return interval is not None and (
        interval[0] <= factor + TOLERANCE and interval[1] >= factor - TOLERANCE
    )


def _extent(interval: Interval | None) -> float:
    return 0.0 if interval is None else 1.0 / (1.0 + interval[0]) - 1.0 / (1.0 + interval[1])


@dataclass(frozen=True, eq=False)
class StandardErrors:
    """Standard errors of the flow's force and torque (3,) and of the friction coefficient.

    `about`: reference point (3,) of the torque, by default the centre of mass.
    """

    flow_force: Floats = field(default_factory=lambda: np.zeros(3))
    flow_couple: Floats = field(default_factory=lambda: np.zeros(3))
    friction: float = 0.0
    about: Floats | None = None

    @property
    def sizes(self) -> Floats:
        return np.array([*self.flow_force, *self.flow_couple, self.friction], dtype=float)

    def wrenches(self, centre: Floats) -> Floats:
        """Force and torque about the centre of mass (6, 6) of one standard error of each component."""
        errors, about = np.diag(self.sizes[:6]), centre if self.about is None else self.about
        errors[:3, 3:] = np.cross(np.subtract(about, centre), errors[:3, :3])
        return errors


@dataclass(frozen=True)
class Probability:
    """A probability, its standard error, and both in words.

    For k of n cases k / n, and the standard deviation of Beta(k + 1, n - k + 1), the posterior of a
    uniform prior. `words`: "34.1 +- 1.5%"; for k = 0 and k = n the 95% bound: "<0.3%".
    """

    value: float
    standard_error: float
    words: str

    @classmethod
    def of(cls, count: int, total: int) -> "Probability":
        mean = (count + 1.0) / (total + 2.0)
        error = float(np.sqrt(mean * (1.0 - mean) / (total + 3.0)))
        extreme = count in (0, total)
        # The bound if all cases agree; as many decimals as it or the standard error needs.
        percent = 100.0 * (1.0 - 0.05 ** (1.0 / (total + 1.0)) if extreme else error)
        digits = max(1, -math.floor(math.log10(percent)))
        words = f"{100.0 * count / total:.{digits}f} +- {percent:.{digits}f}%"
        if extreme:
            words = f"<{percent:.{digits}f}%" if count == 0 else f">{100.0 - percent:.{digits}f}%"
        return cls(count / total, error, words)


@dataclass(frozen=True)
class Within:
    """Safety factors with every input within two standard errors; `certain`: all give one verdict."""

    low: float
    high: float
    certain: bool  # whether all of these cases rest, or all move
    sentence: str

    @classmethod
    def of(cls, bounds: SafetyRange) -> "Within":
        says = "it may rest and it may move"
        if bounds.rests or bounds.moves:
            says = f"it {'moves' if bounds.moves else 'rests'} for certain"
        factors = f"safety factor between {bounds.low:.4g} and {bounds.high:.4g}"
        if bounds.high == 0.0:
            factors = f"safety factor 0, {held_words(bounds.possible, bounds.guaranteed)}"
        words = f"if no input deviates by more than {WITHIN:g} standard errors {says}, {factors}"
        return cls(bounds.low, bounds.high, bounds.rests or bounds.moves, words)


@dataclass(frozen=True)
class Probabilities:
    """Probabilities of the modes, and the influence of each input."""

    samples: int
    seed: int
    # Probability of each observed mode, by the paper's criteria and by the exact one, most likely first.
    criteria: dict[str, Probability]
    equilibrium: dict[str, Probability]
    # Probability of motion, by the paper's criteria and by the exact one.
    moves_criteria: Probability
    moves_equilibrium: Probability
    same: Probability  # that both criteria agree on rest or motion
    margin: tuple[float, float, float]  # 5%, 50% and 95% of the safety factor
    influence: dict[str, float]  # first-order fraction of the variance, of each input
    most: str | None  # the most influential input; None if the margin does not vary
    within: Within  # range within two standard errors

    @property
    def sentence(self) -> str:
        text = f"with the standard errors given it moves with a probability of {self.moves_equilibrium.words}"
        if self.most is not None:
            part = self.influence[self.most]
            text += f"; the most influential input is {self.most}, {part:.0%} of the variance of the margin"
        return text


def probabilities(
    load: Load,
    contacts: Contacts,
    law: Law,
    errors: StandardErrors,
    samples: int = 1000,
    seed: int = 0,
    mass_and_inertia: MassAndInertia | None = None,
) -> Probabilities:
    """Evaluate `samples` cases with normal, independent errors of load and friction (at least zero).

    Without `mass_and_inertia` the exact criterion distinguishes rest and motion only. Raises
    SceneError as `classify` does, and for less than one sample.
    """
    if samples < 1:
        raise SceneError(f"samples is {samples}; give 1 or more")
    cone, of_load = FrictionCone.of(law), errors.wrenches(load.centre)
    inputs = np.random.default_rng(seed).standard_normal((samples, 7))
    flows = load.wrenches[0] + inputs[:, :6] @ of_load
    inputs[:, 6] = np.maximum(cone.coefficient + errors.friction * inputs[:, 6], 0.0)
    surface, laws = (contacts.points, contacts.normals), replace(cone, coefficient=inputs[:, 6])
    acting = flows[:, :3], flows[:, 3:], load.weight, load.centre
    cases = Cases(*surface, *acting, laws, *(mass_and_inertia or ()))
    cases = replace(cases, areas=contacts.areas)
    paper = [classify(*cases.case(i)[:3]).mode for i in range(samples)]
    exact = judge_many(cases).complete()
    moves = np.array([mode.moves for mode in paper])
    margin = 1.0 - 1.0 / (1.0 + exact.factors)
    varied = {INPUTS[k]: inputs[:, k] for k in np.flatnonzero(errors.sizes)}
    influence = influences(varied, margin)
    box = WITHIN * of_load, WITHIN * errors.friction
    return Probabilities(
        samples=samples,
        seed=seed,
        criteria=_fractions(mode.label for mode in paper),
        equilibrium=_fractions(exact.mode_names),
        moves_criteria=Probability.of(int(moves.sum()), samples),
        moves_equilibrium=Probability.of(int((~exact.held).sum()), samples),
        same=Probability.of(int((moves != exact.held).sum()), samples),
        # The nearest of the factors, since some may be infinite.
        margin=tuple(np.quantile(exact.factors, (0.05, 0.5, 0.95), method="nearest").tolist()),
        influence=influence,
        most=max(influence, key=lambda name: influence[name]) if influence else None,
        within=Within.of(safety_range(load, contacts, cone, *box)),
    )


def influences(inputs: Mapping[str, Floats], output: Floats) -> dict[str, float]:
    """Sobol's first index: the fraction of the variance of an output (n,) explained by each input (n,).

    From means over equal classes of the input, corrected for their number (epsilon squared); empty for a
    constant output.
    """
    if np.ptp(output) <= 1e-12 * max(float(np.abs(output).max()), 1e-300):
        return {}
    return {name: _correlation_ratio(values, output) for name, values in inputs.items()}


def _correlation_ratio(values: Floats, output: Floats) -> float:
    # At most 20 classes, with at least ten cases each.
    count, classes = len(output), max(2, min(20, len(output) // 10))
    if count <= classes:
        return 0.0
    parts = np.array_split(output[np.argsort(values, kind="stable")], classes)
    within = sum(float(((part - part.mean()) ** 2).sum()) for part in parts)
    total = float(((output - output.mean()) ** 2).sum())
    return min(1.0, max(0.0, 1.0 - within / (count - classes) * (count - 1) / total))


def _fractions(labels: Iterable[str]) -> dict[str, Probability]:
    counted = Counter(labels)
    total = counted.total()
    return {label: Probability.of(count, total) for label, count in counted.most_common()}
