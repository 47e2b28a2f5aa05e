"""Forces within friction cones that balance a load: the conditions of the best ones, and a groove by hand."""

import numpy as np
import pytest

from incipient.geometry.contacts import frame_of
from incipient.geometry.statics import hold

SIZE = 1.7


def cone(normals, friction, count=3600):
    """Generators (count, k, 3) of friction cones about unit normals (k, 3)."""
    first, second = frame_of(normals)
    angle = 2.0 * np.pi * np.arange(count)[:, None, None] / count
    return normals + friction * (np.cos(angle) * first + np.sin(angle) * second)


@pytest.mark.parametrize("seed", range(12))
def test_the_remainder_is_the_least_there_is(seed):
    """The remainder r is least if r . w >= 0 for all wrenches w of the cones and r . (r - load) = 0."""
    random = np.random.default_rng(seed)
    count, friction = int(random.integers(1, 5)), float(random.uniform(0.05, 1.2))
    normals, arms = random.normal(size=(2, count, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    load = random.normal(size=6)
    held = hold(load, normals, arms, friction, SIZE)
    assert held.remainder == pytest.approx(load + held.factors @ held.rows, abs=1e-12)
    assert held.remainder @ (held.remainder - load) == pytest.approx(0.0, abs=1e-10)
    force = cone(normals, friction)
    power = force @ held.remainder[:3] + np.cross(arms, force) @ held.remainder[3:] / SIZE
    assert power.min() >= -1e-8
    used = held.rows[:, :3]  # generators: unit along the normal, friction across it
    along = (used * normals[held.owner]).sum(axis=1)
    across = np.linalg.norm(used - along[:, None] * normals[held.owner], axis=1)
    assert along == pytest.approx(1.0) and (across <= friction * (1.0 + 1e-12)).all()


@pytest.mark.parametrize("turn", np.linspace(0.0, 0.35, 5))
@pytest.mark.parametrize(("share", "held"), [(0.9995, True), (1.0005, False)])
def test_a_groove_holds_along_its_axis_up_to_the_cones_themselves(turn, share, held):
    """By hand: tan(a) = friction / (cos b sqrt(1 - (friction tan b)^2)) at the limit, with sides at b = 50 degrees.

    Friction f along the axis and t down each side, N = (W/2 + t sin b) / cos b and f^2 + t^2 = (friction N)^2: f is
    largest for t = friction^2 N tan b. An inscribed polygon of sixteen sides falls short of f by up to 2%.
    """
    friction, side = 0.4, np.radians(50.0)
    wedged = np.sqrt(1.0 - (friction * np.tan(side)) ** 2)
    slope = share * friction / (np.cos(side) * wedged)
    c, s = np.cos(turn), np.sin(turn)
    turned = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])  # about the vertical
    sides = np.array([[0.0, np.sin(side), np.cos(side)], [0.0, -np.sin(side), np.cos(side)]])
    normals = sides @ turned.T
    load = np.append(turned @ [slope, 0.0, -1.0], np.zeros(3)) / np.hypot(slope, 1.0)
    # Forces through the centre: the couple does not matter.
    remainder = hold(load, normals, np.zeros((2, 3)), friction, 1.0).remainder
    assert (np.abs(remainder).max() < 1e-9) == held
