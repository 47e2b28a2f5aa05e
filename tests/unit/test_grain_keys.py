"""A grain's mass has one source for all that weighs or turns; a gap that is wide is warned of."""

import math

import numpy as np
import pytest
from scenes import scene

from incipient.planning.plan import make_plan
from incipient.scene import Contact, Disc, Gravity, Time
from incipient.scene.mass import mass_and_inertia
from incipient.setup.body import rigid_body
from incipient.setup.setup import Setup

AREA, MASS = math.pi / 4, 2.0
WEIGHED = [{"density": MASS / AREA}, {"mass": MASS}]
GRAVITY = Gravity(acceleration=10)


@pytest.mark.parametrize("keys", WEIGHED, ids=lambda keys: next(iter(keys)))
def test_mass_or_density_give_the_same_grain(keys):
    """Weight, moment of inertia (m d^2/8 of a disc), stress unit of the Shields number, and a free grain's inertia."""
    found = scene(body=Disc(diameter=1, x=4, **keys), gravity=GRAVITY)
    assert (found.mass, found.density) == pytest.approx((MASS, MASS / AREA))
    mass, inertia = mass_and_inertia(found.body)
    assert mass == pytest.approx(MASS) and inertia == pytest.approx(MASS / 8 * np.eye(3), rel=1e-4)
    assert Setup(found).stress_unit == pytest.approx((MASS / AREA - 1) * 10)
    free = scene(
        body=Disc(diameter=1, centre=(4, 2), motion="free", **keys), time=Time(end=1, step=0.1)
    )
    inert = rigid_body(free.body).inertia
    assert (inert.mass, inert.moments[0]) == pytest.approx((MASS, MASS / 8), rel=1e-4)
    assert make_plan(found).numbers.density_ratio == pytest.approx(MASS / AREA)


def test_a_moment_that_is_given_is_that_of_grains_at_rest_and_free():
    found = scene(body=Disc(diameter=1, x=4, density=2, inertia=0.5), gravity=GRAVITY)
    assert mass_and_inertia(found.body)[1] == pytest.approx(0.5 * np.eye(3))
    body = Disc(diameter=1, centre=(4, 2), motion="free", density=2, inertia=0.5)
    free = rigid_body(scene(body=body, time=Time(end=1, step=0.1)).body).inertia
    assert (free.mass, free.moments[0]) == pytest.approx((2 * AREA, 0.5))


@pytest.mark.parametrize("keys", [{}, {"density": 0.0}, {"mass": 1.0, "inertia": 0.0}])
def test_how_a_grain_turns_is_not_known_without_mass_or_moment(keys):
    assert mass_and_inertia(Disc(diameter=1, x=4, **keys)) is None


@pytest.mark.parametrize(("gap", "warned"), [(0.03, False), (0.031, True), (0.1, True)])
def test_a_wide_gap_is_warned_of(gap, warned):
    plan = make_plan(scene(contact=Contact(friction=0.5, gap=gap)))
    assert len(plan.warnings) == warned
    assert (f"warning: contact.gap = {gap:g} is wide" in plan.text()) is warned
    assert list(plan.to_dict()["warnings"]) == list(plan.warnings)
