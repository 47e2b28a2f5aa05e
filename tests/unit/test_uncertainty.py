"""Probabilities of modes from standard errors: against the normal distribution where it can be written down."""

from math import erf, sqrt

import numpy as np
import pytest

from incipient.contact import Contacts, Load
from incipient.contact.robustness import (
    Probability,
    StandardErrors,
    draw,
    influences,
    probabilities,
)
from incipient.errors import SceneError

DOWN = [0.0, -1.0, 0.0]
BLOCK = Contacts([[-1.0, -0.1, 0.0], [1.0, -0.1, 0.0]], [DOWN, DOWN])
INERT = (1.0, np.eye(3))


def pushed(force, couple=0.0):
    """A flat block of unit weight, centre of mass at the origin, pushed along its plane."""
    return Load([force, 0.0, 0.0], [0.0, 0.0, couple], [0.0, -1.0, 0.0], [0.0, 0.0, 0.0])


def below(value, mean, deviation):
    """P(X < value) of a normal X."""
    return 0.5 * (1.0 + erf((value - mean) / (deviation * sqrt(2.0))))


class TestProbability:
    @pytest.mark.parametrize(("force", "error"), [(0.3, 0.1), (0.45, 0.05), (0.5, 0.2)])
    def test_block_pushed_with_an_error(self, force, error):
        # It slides if |F| > friction N = 0.5: P = 1 - Phi((0.5 - f) / s) + Phi((-0.5 - f) / s).
        exact = 1.0 - below(0.5, force, error) + below(-0.5, force, error)
        found = probabilities(pushed(force), BLOCK, 0.5, StandardErrors([error, 0, 0]), 400, 3)
        for judge in (found.moves_equilibrium, found.moves_criteria):
            assert abs(judge.value - exact) < 4.0 * judge.standard_error
        # On a plane and without a couple both judges say the same of every case.
        assert found.same.value == 1.0
        assert found.most == "flow_force x"

    def test_block_on_a_plane_of_uncertain_friction(self):
        # It slides if friction < F / N = 0.3.
        found = probabilities(pushed(0.3), BLOCK, 0.35, StandardErrors(friction=0.05), 400, 5)
        exact = below(0.3, 0.35, 0.05)
        assert (
            abs(found.moves_equilibrium.value - exact)
            < 4.0 * found.moves_equilibrium.standard_error
        )
        assert set(found.influence) == {"friction"}
        assert found.influence["friction"] > 0.95

    def test_modes_of_each_judge_add_up_to_one(self):
        errors = StandardErrors([0.2, 0.2, 0.0], [0.0, 0.0, 0.2], 0.1)
        found = probabilities(pushed(0.4, -0.1), BLOCK, 0.5, errors, 100, 1, INERT)
        for judge in (found.criteria, found.equilibrium):
            assert sum(chance.value for chance in judge.values()) == pytest.approx(1.0)
            assert [chance.value for chance in judge.values()] == sorted(
                (chance.value for chance in judge.values()), reverse=True
            )
        rest = found.equilibrium.get("rest", Probability.of(0, 100)).value
        assert rest == pytest.approx(1.0 - found.moves_equilibrium.value)
        low, middle, high = found.margin
        assert low <= middle <= high
        assert "probability" in found.sentence

    def test_seed_decides(self):
        errors = StandardErrors([0.1, 0, 0], friction=0.05)
        first, again, other = (
            probabilities(pushed(0.45), BLOCK, 0.5, errors, 60, seed) for seed in (1, 1, 2)
        )
        assert first == again
        assert first.margin != other.margin

    def test_without_errors_one_case_is_all(self):
        found = probabilities(pushed(0.6), BLOCK, 0.5, StandardErrors(), 12, 0)
        assert found.moves_equilibrium.value == 1.0
        assert (found.influence, found.most, found.interactions) == ({}, None, 0.0)

    @pytest.mark.parametrize(("count", "total"), [(0, 50), (50, 50), (20, 50)])
    def test_standard_error(self, count, total):
        # Beta(k + 1, n - k + 1): variance a b / ((a + b)^2 (a + b + 1)).
        a, b = count + 1, total - count + 1
        found = Probability.of(count, total)
        assert found.value == count / total
        assert found.standard_error == pytest.approx(sqrt(a * b / ((a + b) ** 2 * (a + b + 1))))

    @pytest.mark.parametrize(
        ("count", "total", "words"),
        [
            (0, 500, "<0.6%"),
            (500, 500, ">99.4%"),
            (0, 100_000, "<0.003%"),
            (2, 500, "0.4 +- 0.3%"),
            (5, 100_000, "0.005 +- 0.002%"),
            (170, 500, "34.0 +- 2.1%"),
        ],
    )
    def test_words(self, count, total, words):
        # Where none of n cases moves, (1 - p)^(n + 1) = 5% is the largest p that is not unlikely.
        assert Probability.of(count, total).words == words


class TestWithin:
    """What is certain while no input is off by more than two standard errors; cases drawn prove nothing of that."""

    def test_a_load_that_is_held_but_never_drawn(self):
        # A disc on a plane is held only without a couple about the contact, which has a probability of zero.
        disc = Contacts([[0.0, -0.5, 0.0]], [DOWN])
        found = probabilities(
            pushed(0.0, 0.1), disc, 0.5, StandardErrors([0, 0, 0], [0, 0, 0.1]), 100
        )
        assert found.moves_equilibrium.words == ">97.1%"
        assert not found.within.certain
        assert (found.within.low, found.within.high) == (0.0, np.inf)
        assert "it may rest and it may move" in found.within.sentence

    @pytest.mark.parametrize(("force", "certain"), [(0.2, True), (0.45, False), (0.8, True)])
    def test_block(self, force, certain):
        # It slides if F > friction: 0.5 / F, with F to 0.1 and friction to 0.05.
        errors = StandardErrors([0.05, 0, 0], friction=0.025)
        within = probabilities(pushed(force), BLOCK, 0.5, errors, 10).within
        expected = (0.45 / (force + 0.1), 0.55 / (force - 0.1))
        assert (within.low, within.high) == pytest.approx(expected)
        assert within.certain == certain
        says = (
            "it may rest"
            if not certain
            else "it rests for certain"
            if force < 0.5
            else "it moves for certain"
        )
        assert says in within.sentence

    def test_couple_about_the_contact(self):
        # Known about the contact the couple there is zero whatever the force.
        disc, spread = Contacts([[0.0, -0.5, 0.0]], [DOWN]), [0.1, 0.0, 0.0]
        balanced = pushed(0.3, 0.15)
        about = StandardErrors(spread, about=[0.0, -0.5, 0.0])
        assert probabilities(balanced, disc, 10.0, about, 10).within.certain
        assert not probabilities(balanced, disc, 10.0, StandardErrors(spread), 10).within.certain


class TestInfluence:
    def test_linear_output(self):
        # Y = 2 X1 + X2, unit variances: first-order shares 4/5 and 1/5; X3 has none.
        x = np.random.default_rng(0).standard_normal((20000, 3))
        found = influences({"a": x[:, 0], "b": x[:, 1], "c": x[:, 2]}, 2.0 * x[:, 0] + x[:, 1])
        assert found["a"] == pytest.approx(0.8, abs=0.02)
        assert found["b"] == pytest.approx(0.2, abs=0.02)
        assert found["c"] == pytest.approx(0.0, abs=0.005)

    def test_without_correlation(self):
        # Y = X^2 is not correlated with X, and yet X decides it (but for its spread within classes).
        x = np.random.default_rng(0).standard_normal(5000)
        assert influences({"x": x}, x**2)["x"] > 0.8

    def test_pure_interaction(self):
        # Y = X1 X2: both first-order shares are zero.
        x = np.random.default_rng(0).standard_normal((20000, 2))
        found = influences({"a": x[:, 0], "b": x[:, 1]}, x[:, 0] * x[:, 1])
        assert max(found.values()) < 0.01

    def test_small_samples_are_not_flattered(self):
        # Without the correction for classes, 10 classes in 100 cases of noise would show a tenth.
        shares = []
        for seed in range(40):
            x = np.random.default_rng(seed).standard_normal((100, 2))
            shares.append(influences({"x": x[:, 0]}, x[:, 1])["x"])
        assert np.mean(shares) < 0.05

    def test_constant_output_has_none(self):
        assert influences({"x": np.arange(10.0)}, np.ones(10)) == {}


class TestDrawing:
    def test_spread(self):
        errors = StandardErrors([0.1, 0.2, 0.3], [0.4, 0.5, 0.6], 0.05)
        drawn = draw(pushed(1.0, 2.0), 0.5, errors, 20000, 0)
        assert {name: np.std(values) for name, values in drawn.items()} == pytest.approx(
            errors.sizes, rel=0.03
        )
        assert np.mean(drawn["flow_force x"]) == pytest.approx(1.0, abs=0.005)
        assert np.mean(drawn["flow_couple z"]) == pytest.approx(2.0, abs=0.02)

    def test_friction_is_cut_off_at_zero(self):
        drawn = draw(pushed(0.1), 0.1, StandardErrors(friction=0.2), 1000, 0)
        assert drawn["friction"].min() == 0.0

    def test_couple_about_the_contact(self):
        # A disc is balanced if nothing turns it about its contact: couple = R F. Known about that contact the
        # couple is zero whatever the force, so it rests for certain; known about the centre it is not.
        disc, force = Contacts([[0.0, -0.5, 0.0]], [DOWN]), 0.2
        spread = [0.1, 0.0, 0.0]
        balanced = pushed(force, 0.5 * force)
        about = StandardErrors(spread, about=[0.0, -0.5, 0.0])
        assert draw(balanced, 10.0, about, 50, 0)["flow_couple z"] == pytest.approx(
            np.zeros(50), abs=1e-15
        )
        certain = probabilities(balanced, disc, 10.0, about, 50, 0)
        assert certain.moves_equilibrium.value == 0.0
        assert (
            probabilities(
                balanced, disc, 10.0, StandardErrors(spread), 50, 0
            ).moves_equilibrium.value
            == 1.0
        )

    @pytest.mark.parametrize(
        "wrong",
        [{"flow_force": [1.0, 2.0]}, {"flow_couple": [0, 0, -1.0]}, {"friction": float("nan")}],
    )
    def test_wrong_errors(self, wrong):
        with pytest.raises(SceneError, match="standard errors"):
            StandardErrors(**wrong)

    def test_no_sample(self):
        with pytest.raises(SceneError, match="at least one case"):
            probabilities(pushed(0.1), BLOCK, 0.5, StandardErrors(), 0)
