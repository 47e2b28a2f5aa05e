"""Scenes with grains of unusual shapes that settle: from the scene file to the verdict and its pictures."""

import pytest
from images import assert_is_a_picture
from processes import result_of

from incipient.cli import main

SCENE = """\
[domain]
length = 6
height = 3
[fluid]
reynolds = 1
scale = "grain"
inertia = false
[flow]
kind = "shear"
[body]
{body}
x = 2.4
angle = 20
density = 2.65
settle = true
[bed]
{bed}
[gravity]
acceleration = 10
[contact]
friction = 0.5
[numerics]
mesh_size = 2
error_bars = false
[output]
pictures = true
"""
STAR = 'shape = "star"\nradius = 0.5\ncosines = [0, 0.2]\nsines = [0, 0, 0.1]'
DISCS = 'shape = "discs"\ndiscs = [[0, 0, 0.4], [0.5, 0.1, 0.3], [0.1, 0.5, 0.25]]'
HALF_DISCS = 'kind = "half-discs"\nradius = 0.4\nspacing = 0.9'
SINUSOIDAL = 'kind = "sinusoidal"\namplitude = 0.1\nwavelength = 1.2'


@pytest.mark.slow
@pytest.mark.parametrize(
    ("body", "bed"),
    [
        pytest.param(STAR, HALF_DISCS, id="star", marks=pytest.mark.slow),
        pytest.param(DISCS, SINUSOIDAL, id="discs"),
    ],
)
def test_a_settled_grain_is_judged_and_drawn(tmp_path, body, bed):
    (tmp_path / "case.toml").write_text(SCENE.format(body=body, bed=bed))
    assert main(["run", str(tmp_path / "case.toml"), "--out", str(tmp_path / "out")]) == 0
    result = result_of(tmp_path / "out")
    # It rests: two contacts, on either side of its centre, that hold it without the flow.
    left, right = sorted(contact["point"][0] for contact in result["contacts"])
    assert left < result["grain"]["centre"][0] < right
    assert result["verdict"]["safety_factor"] > 0
    assert result["force"]["flow"][0] > 0
    for name in ("flow", "verdict", "mesh"):
        assert_is_a_picture(tmp_path / "out" / f"{name}.png", margin=False)
