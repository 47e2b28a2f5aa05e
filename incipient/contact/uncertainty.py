"""Probabilities of the modes of a load with standard errors, by both judges, and the input that matters most.

Cases drawn prove nothing of those that were not: a load that is held may be a rare one. Beside the probabilities it is
therefore said what is certain while no input is off by more than two standard errors, by `error_box.safety_range`.

Cases are drawn with errors that are normal and independent (friction cut off at zero), and each is judged. The
influence of an input is its first-order share of the variance of the margin s / (1 + s), s the safety factor: the
correlation ratio Var(E[margin | input]) / Var(margin), Sobol's first-order index for independent inputs, estimated
from the means over classes of the input of equal size and corrected for their number (epsilon squared).
"""

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from incipient.arrays import Floats
from incipient.contact.exact.judge import MassAndInertia, judged
from incipient.contact.loads.error_box import ErrorBox, SafetyRange, held_words, safety_range
from incipient.contact.model import Load
from incipient.contact.paper import criteria
from incipient.errors import SceneError
from incipient.geometry.contacts import Contacts

CLASSES = 20  # at most, and not fewer than ten cases in each
AXES = "xyz"
WITHIN = 2.0  # standard errors of every input, for what is certain
DOUBT = 0.05  # the chance that a probability of which no case was drawn is larger than it is said to be below


@dataclass(frozen=True, eq=False)
class StandardErrors:
    """Standard errors of the flow's force and couple (3,) and of the friction coefficient.

    `about`: the point (3,) that the couple was measured about; an error of the force then moves the couple
    about the centre of mass as well. None: the centre of mass.
    """

    flow_force: Floats = field(default_factory=lambda: np.zeros(3))
    flow_couple: Floats = field(default_factory=lambda: np.zeros(3))
    friction: float = 0.0
    about: Floats | None = None

    def __post_init__(self) -> None:
        for name in ("flow_force", "flow_couple"):
            given = np.array(getattr(self, name), dtype=float)
            if given.shape != (3,) or not (np.isfinite(given).all() and (given >= 0.0).all()):
                raise SceneError(
                    f"standard errors: {name} is not three numbers of at least 0; give such"
                )
            object.__setattr__(self, name, given)
        if not (np.isfinite(self.friction) and self.friction >= 0.0):
            raise SceneError(
                f"standard errors: friction is {self.friction}; give a number of at least 0"
            )

    @property
    def sizes(self) -> dict[str, float]:
        """The standard error of each input that has one, by its name."""
        named = {f"flow_force {AXES[k]}": float(self.flow_force[k]) for k in range(3)}
        named |= {f"flow_couple {AXES[k]}": float(self.flow_couple[k]) for k in range(3)}
        named["friction"] = float(self.friction)
        return {name: size for name, size in named.items() if size > 0.0}

    def arm(self, centre: Floats) -> Floats:
        """From the centre of mass to the point that the couple is measured about, (3,)."""
        return np.zeros(3) if self.about is None else np.asarray(self.about, dtype=float) - centre

    def box(self, centre: Floats) -> ErrorBox:
        """The loads and frictions of which no input is off by more than two standard errors; `centre` of mass (3,)."""
        ways = WITHIN * np.diag(np.concatenate([self.flow_force, self.flow_couple]))
        ways[3:, :3] = np.cross(self.arm(centre), ways[:3, :3].T).T
        return ErrorBox(ways[:, ways.any(axis=0)], WITHIN * self.friction)


@dataclass(frozen=True)
class Probability:
    """A probability, its standard error, and both in words.

    Of k cases in n: k / n, and the standard deviation of Beta(k + 1, n - k + 1), which is what is known of it
    after n cases without prior knowledge; it is not zero where all cases agree. `words`: "34.1 +- 1.5%"; where no
    case was drawn, or no other, the bound that it is on the right side of with a chance of 95%: "<0.3%".
    """

    value: float
    standard_error: float
    words: str

    @classmethod
    def of(cls, count: int, total: int) -> "Probability":
        """The probability of what happened in `count` of `total` cases, with its standard error."""
        mean = (count + 1.0) / (total + 2.0)
        error = float(np.sqrt(mean * (1.0 - mean) / (total + 3.0)))
        return cls(count / total, error, _words(count, total, error))


@dataclass(frozen=True)
class Within:
    """What is certain while no input is off by more than two standard errors."""

    # The smallest and the largest safety factor.
    low: float
    high: float
    certain: bool  # whether all of these cases rest, or all move
    sentence: str

    @classmethod
    def of(cls, found: SafetyRange) -> "Within":
        """A range of safety factors in words."""
        says = "it moves" if found.moves else "it rests"
        says = (
            f"{says} for certain" if found.rests or found.moves else "it may rest and it may move"
        )
        factors = f"safety factor between {found.low:.4g} and {found.high:.4g}"
        if found.high == 0.0:
            factors = f"safety factor 0, {held_words(found.some, found.every)}"
        words = f"while no input is off by more than {WITHIN:g} standard errors {says}, {factors}"
        return cls(found.low, found.high, found.rests or found.moves, words)


@dataclass(frozen=True)
class Probabilities:
    """How likely each mode is, and what that depends on."""

    samples: int
    seed: int
    # Probability of each mode met, by the paper's judge and by the exact one, the most likely first.
    criteria: dict[str, Probability]
    equilibrium: dict[str, Probability]
    # Probability that the grain moves, by the paper's judge and by the exact one.
    moves_criteria: Probability
    moves_equilibrium: Probability
    same: Probability  # that the judges agree on whether it does
    margin: tuple[float, float, float]  # 5%, 50% and 95% of the safety factor
    influence: dict[str, float]  # first-order share of each input
    interactions: float  # what is left of the variance
    most: str | None  # the input that matters most; None: the margin does not vary
    within: Within  # what is certain

    @property
    def sentence(self) -> str:
        """The outcome in a sentence."""
        said = f"with the standard errors given it moves with a probability of {self.moves_equilibrium.words}"
        if self.most is not None:
            share = self.influence[self.most]
            said += f"; what matters most is {self.most}, {share:.0%} of the variance of the margin"
        return said


def probabilities(
    load: Load,
    contacts: Contacts,
    friction: float,
    errors: StandardErrors,
    samples: int = 1000,
    seed: int = 0,
    mass_and_inertia: MassAndInertia | None = None,
) -> Probabilities:
    """Judge `samples` cases drawn around a load and friction with standard errors.

    Without `mass_and_inertia` the exact judge says only whether the grain rests or moves.

    Raises SceneError as `criteria.classify` does, and for less than one sample.
    """
    if samples < 1:
        raise SceneError(f"samples is {samples}; draw at least one case")
    drawn = draw(load, friction, errors, samples, seed)
    cases = list(_cases(load, errors, drawn))
    paper = [criteria.classify(acting, contacts, coefficient).mode for acting, coefficient in cases]
    exact = [
        judged(acting, contacts, coefficient, mass_and_inertia) for acting, coefficient in cases
    ]
    moves = np.array([(one.moves, other.moves) for one, other in zip(paper, exact, strict=True)])
    factors = np.array([result.safety.value for result in exact])
    influence = influences({name: drawn[name] for name in errors.sizes}, _margin(factors))
    return Probabilities(
        samples=samples,
        seed=seed,
        criteria=_shares(mode.label for mode in paper),
        equilibrium=_shares(result.label for result in exact),
        moves_criteria=Probability.of(int(moves[:, 0].sum()), samples),
        moves_equilibrium=Probability.of(int(moves[:, 1].sum()), samples),
        same=Probability.of(int((moves[:, 0] == moves[:, 1]).sum()), samples),
        # The nearest of the factors, since some may be infinite.
        margin=tuple(np.quantile(factors, (0.05, 0.5, 0.95), method="nearest").tolist()),
        influence=influence,
        interactions=max(0.0, 1.0 - sum(influence.values())) if influence else 0.0,
        most=max(influence, key=lambda name: influence[name]) if influence else None,
        within=Within.of(safety_range(load, contacts, friction, errors.box(load.centre))),
    )


def draw(
    load: Load, friction: float, errors: StandardErrors, samples: int, seed: int
) -> dict[str, Floats]:
    """Independent values (samples,) of every input by name: ``flow_force x`` ... ``flow_couple z``, ``friction``.

    Couples are about `errors.about`; an input without error keeps its value.
    """
    noise = np.random.default_rng(seed).standard_normal((samples, 7))
    force = load.flow_force + noise[:, :3] * errors.flow_force
    couple = load.flow_couple - np.cross(errors.arm(load.centre), load.flow_force)
    couple = couple + noise[:, 3:6] * errors.flow_couple
    drawn = {f"flow_force {AXES[k]}": force[:, k] for k in range(3)}
    drawn |= {f"flow_couple {AXES[k]}": couple[:, k] for k in range(3)}
    return drawn | {"friction": np.maximum(friction + noise[:, 6] * errors.friction, 0.0)}


def _cases(
    load: Load, errors: StandardErrors, drawn: Mapping[str, Floats]
) -> Iterator[tuple[Load, float]]:
    """The load, its couple about the centre, and the friction of every case."""
    force, couple = (
        np.column_stack([drawn[f"{name} {axis}"] for axis in AXES])
        for name in ("flow_force", "flow_couple")
    )
    couple = couple + np.cross(errors.arm(load.centre), force)
    for one, turn, friction in zip(force, couple, drawn["friction"], strict=True):
        yield Load(one, turn, load.weight, load.centre), float(friction)


def influences(inputs: Mapping[str, Floats], output: Floats) -> dict[str, float]:
    """First-order share of every input (n,) in the variance of an output (n,); empty if that does not vary."""
    if np.ptp(output) <= 1e-12 * max(float(np.abs(output).max()), 1e-300):
        return {}
    return {name: _correlation_ratio(values, output) for name, values in inputs.items()}


def _correlation_ratio(values: Floats, output: Floats) -> float:
    """Epsilon squared of the output over classes of the input of equal size."""
    classes = max(2, min(CLASSES, len(output) // 10))
    parts = np.array_split(output[np.argsort(values, kind="stable")], classes)
    within = sum(float(((part - part.mean()) ** 2).sum()) for part in parts)
    total = float(((output - output.mean()) ** 2).sum())
    free = len(output) - classes
    if free <= 0:
        return 0.0
    return min(1.0, max(0.0, 1.0 - within / free * (len(output) - 1) / total))


def _margin(factors: Floats) -> Floats:
    """s / (1 + s), from 0 to 1 for factors from 0 to infinity."""
    finite = np.where(np.isfinite(factors), factors, 0.0)
    return np.where(np.isfinite(factors), finite / (1.0 + finite), 1.0)


def _shares(labels: Iterable[str]) -> dict[str, Probability]:
    counted = Counter(labels)
    total = counted.total()
    return {label: Probability.of(count, total) for label, count in counted.most_common()}


def _words(count: int, total: int, error: float) -> str:
    """A probability in percent, with as many digits as its standard error has; a bound where all cases agree."""
    if count in (0, total):
        bound = 100.0 * (1.0 - DOUBT ** (1.0 / (total + 1.0)))
        digits = _digits(bound)
        return f"<{bound:.{digits}f}%" if count == 0 else f">{100.0 - bound:.{digits}f}%"
    digits = _digits(100.0 * error)
    return f"{100.0 * count / total:.{digits}f} +- {100.0 * error:.{digits}f}%"


def _digits(percent: float) -> int:
    """Decimals with which one digit of a small percentage is seen, one at least."""
    return max(1, -math.floor(math.log10(percent)))
