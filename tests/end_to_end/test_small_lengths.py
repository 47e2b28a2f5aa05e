"""Scenes in metres for grains of microns: the same coefficients as in units of the grain, or one line."""

import pytest

import incipient
from incipient.errors import ConvergenceError
from incipient.scene import Scene, loads

SCENE = """
[domain]
length = 24e{power}
height = 20e{power}
[fluid]
reynolds = 20.0
scale = "grain"
[flow]
kind = "shear"
[body]
shape = "disc"
diameter = 1e{power}
x = 16e{power}
density = 2.65
[bed]
kind = "flat"
[gravity]
acceleration = 10e{power}
[contact]
friction = 0.5
[numerics]
mesh_size = 4.0
error_bars = false
[output]
fields = false
"""


def scene(power: int) -> Scene:
    """A disc whose diameter is a power of ten."""
    return loads(SCENE.format(power=power))


@pytest.mark.parametrize("power", [-6, pytest.param(-7, marks=pytest.mark.slow)])
def test_lengths_in_metres_give_what_those_in_microns_do(power: int) -> None:
    """Viscosity is 5e-14 there beside gradients of 1e-6: by its own choice of scales MUMPS finds no pivots."""
    there, here = incipient.run(scene(power)).to_dict(), incipient.run(scene(0)).to_dict()
    for name in ("drag", "lift", "moment"):
        assert there["coefficients"][name] == pytest.approx(here["coefficients"][name], rel=1e-6)
    assert there["verdict"]["mode"] == here["verdict"]["mode"]


def test_numbers_too_far_apart_are_refused_as_such() -> None:
    with pytest.raises(
        ConvergenceError, match=r"numbers differ by a factor of .*: choose units in"
    ):
        incipient.run(scene(-9))
