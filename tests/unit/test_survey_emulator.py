"""The emulator of load coefficients on functions that are known, and thresholds by it."""

import math

import numpy as np
import pytest

pytest.importorskip("sklearn")
from incipient.contact import Contacts
from incipient.survey.full_runs import LoadCoefficients
from incipient.survey.pockets import Pocket
from incipient.survey.request import FlowPast
from incipient.survey.thresholds import (
    NINETY_FIVE,
    Emulator,
    designed,
    features_of,
    range_of,
    thresholds,
)

RANDOM = np.random.default_rng(7)


def drawn(count: int) -> np.ndarray:
    """Features (count, 7) of grains of one size in creeping flow."""
    return np.column_stack([RANDOM.uniform(-1.0, 1.0, (count, 5)), np.ones(count), np.zeros(count)])


def known(features: np.ndarray, noise: float = 0.15) -> np.ndarray:
    """Six coefficients (n, 6) that depend on what is around a grain, smoothly, and on what the features do not say."""
    p, e, s, b, k = features[:, :5].T
    columns = [
        5.0 + 2.0 * p + np.sin(2.0 * e) - s * p,
        0.3 * k,
        e * e,
        0.2 * k,
        1.0 + 0.5 * p * b,
        0.1 * s,
    ]
    return np.column_stack(columns) + noise * RANDOM.standard_normal((len(features), 6))


def pocket(number: int, features: np.ndarray) -> Pocket:
    """A sphere in a pocket of three equal ones, two of them ahead, with features as given."""
    across, height = 1.0 / math.sqrt(3.0), math.sqrt(2.0 / 3.0)
    near = [
        [across * math.cos(a), across * math.sin(a), -height]
        for a in (np.pi / 3, -np.pi / 3, np.pi)
    ]
    return Pocket(
        number=number,
        centre=np.zeros(3),
        diameter=1.0,
        neighbours=np.array(near),
        radii=np.full(3, 0.5),
        contacts=Contacts(0.5 * np.array(near), np.array(near)),
        **dict(
            zip(
                ("protrusion", "exposure", "sheltered", "backed", "skew"), features[:5], strict=True
            )
        ),
        visible=1.0,
        carries=0,
        shifted=0.0,
        pivot=19.47,
        critical_force=math.tan(math.radians(19.47)),
    )


def test_grains_it_never_saw_are_inside_its_bars():
    """95% of 300 grains' coefficients within 1.96 bars, for 60 runs; errors near the noise."""
    features, others = drawn(60), drawn(300)
    means, deviations = Emulator.of(features, known(features)).predicted(others)
    errors = means - known(others)
    within = np.abs(errors) <= NINETY_FIVE * deviations
    assert within.mean() >= 0.95
    assert np.sqrt((errors[:, 0] ** 2).mean()) < 2.0 * 0.15
    assert (
        deviations[:, 0].mean() < 3.0 * 0.15
    )  # bars that hold because they are wide would not help


def test_design_is_spread_out():
    features = drawn(200)
    chosen = features[designed(features, 12)]
    apart = np.linalg.norm(chosen[:, None] - chosen, axis=2) + 9.0 * np.eye(12)
    chance = np.linalg.norm(features[:12, None] - features[:12], axis=2) + 9.0 * np.eye(12)
    assert len(np.unique(chosen, axis=0)) == 12 and apart.min() > 1.5 * chance.min()
    # Further runs extend it, also where features repeat; there are no more than grains.
    assert designed(features, 5) == designed(features, 12)[:5]
    assert sorted(designed(np.ones((4, 7)), 9)) == [0, 1, 2, 3]


def test_thresholds_by_drag_alone():
    """A force through the centre: Shields number (pi/6) tan(angle of repose)/C, with tan = 1/sqrt(8)."""
    features = drawn(12)
    values = np.zeros((12, 6))
    values[:, 0] = 4.0 + features[:, 0]
    runs = [LoadCoefficients(k, 1.0, values[k], None) for k in range(12)]
    grains = [pocket(k, features[k]) for k in range(12)]
    result = thresholds(grains, 1.0, FlowPast(friction=0.5), runs, Emulator.of(features, values))
    for one, value in zip(result, values, strict=True):
        assert one.shields == pytest.approx(math.pi / 6.0 / math.sqrt(8.0) / value[0], rel=1e-6)
        assert one.is_computed and one.draws == pytest.approx(one.shields, rel=1e-9)


def test_bars_of_grains_without_a_run():
    """Emulated thresholds of half the grains against those by their own coefficients."""
    features = drawn(80)
    values = known(features, 0.05)
    values[:, [1, 2, 3, 4, 5]] *= 0.1
    grains = [pocket(k, features[k]) for k in range(80)]
    runs = [LoadCoefficients(k, 1.0, values[k], None) for k in range(50)]
    emulator = Emulator.of(features[:50], values[:50])
    result = thresholds(grains, 1.0, FlowPast(friction=0.5), runs, emulator)
    own = [LoadCoefficients(k, 1.0, values[k], None) for k in range(80)]
    exact = thresholds(grains, 1.0, FlowPast(friction=0.5), own, emulator)
    inside = [
        (bar := range_of(one.draws, one.shields))["low"] <= true.shields <= bar["high"]
        for one, true in zip(result[50:], exact[50:], strict=True)
    ]
    assert np.mean(inside) >= 0.9  # of 95%, the ends of 40 draws being less than that


@pytest.mark.parametrize("ratio", [1.0, 1.5])
def test_a_threshold_with_inertia_is_at_its_own_reynolds_number(ratio):
    """Drag that grows with the Reynolds number: at the threshold C(theta Ga^2) theta = (pi/6) tan, Ga as d^1.5."""
    galileo, numbers = 10.0, np.geomspace(0.3, 30.0, 24)
    features = np.array(
        [features_of(pocket(0, np.zeros(5)), 1.0 / ratio, number) for number in numbers]
    )
    features[:, :5] = RANDOM.uniform(-1.0, 1.0, (24, 5))
    values = 1e-3 * RANDOM.standard_normal((24, 6))
    values[:, 0] = 4.0 + 2.0 * np.log10(numbers)
    emulator = Emulator.of(features, values)
    grains = [pocket(0, np.zeros(5))]
    (result,) = thresholds(
        grains, 1.0 / ratio, FlowPast(friction=0.5, galileo=galileo), [], emulator
    )
    drag = 4.0 + 2.0 * math.log10(result.shields * galileo**2 * ratio**3)
    assert result.shields * drag == pytest.approx(math.pi / 6.0 / math.sqrt(8.0), rel=0.02)


@pytest.mark.parametrize(("runs", "level"), [(8, 8 / 9), (18, 18 / 19), (19, 0.95), (60, 0.95)])
def test_with_what_probability_bars_hold(runs, level):
    """The largest of n errors is not exceeded by the next with a probability of n/(n + 1) (Vovk et al. 2005)."""
    features = drawn(runs)
    assert Emulator.of(features, known(features)).level == pytest.approx(level)


def test_a_range_contains_the_value_without_errors() -> None:
    """A survey of eight runs once printed a median of 0.1357 with a bar from 0.0776 to 0.1315."""
    drawn = np.linspace(0.0, 1.0, 41)
    assert range_of(drawn, 0.5) == {"low": pytest.approx(0.025), "high": pytest.approx(0.975)}
    assert range_of(drawn, 1.5)["high"] == 1.5
    assert range_of(drawn, -0.5)["low"] == -0.5
