"""Scenes in SI units: the dimensionless scene that follows and the way back, against numbers worked out by hand."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from scenes import message

from incipient.planning.plan import make_plan
from incipient.results.si import in_si, si_lines, with_loads
from incipient.scene import dumps, grains, loads
from incipient.setup.setup import Setup

# A grain of quartz of 1 mm in water, in the units of the scene of diameter 2 and shear rate 0.5.
QUARTZ = """
[domain]
length = 24.0
width = 16.0
height = 12.0
[fluid]
scale = "grain"
[flow]
kind = "shear"
rate = 0.5
[body]
shape = "sphere"
diameter = 2.0
x = 10.0
[bed]
kind = "flat"
[contact]
friction = 0.5
[units]
diameter = 1e-3
viscosity = 1e-6
fluid_density = 1000.0
grain_density = 2650.0
gravity = 9.81
shear_rate = 100.0
"""


def test_a_grain_of_quartz_in_water() -> None:
    """L0 = 1e-3/2 m, T0 = 0.5/100 s; Re = 100 (1e-3)^2/1e-6 = 100; g T0^2/L0 = 9.81 x 25e-6/5e-4."""
    scene: Any = loads(QUARTZ)
    numbers = (scene.fluid.reynolds, scene.gravity.acceleration, scene.body.density)
    assert numbers == pytest.approx((100.0, 0.4905, 2.65), rel=1e-14)
    scales = scene.scales
    assert (scales.length, scales.time, scales.velocity) == pytest.approx((5e-4, 5e-3, 0.1))
    assert (scales.force, scales.torque) == pytest.approx((1000.0 * 0.1**2 * 5e-4**2, 1.25e-9))
    assert loads(dumps(scene)) == scene


def test_the_flow_and_loads_in_si() -> None:
    """tau = rho nu times the shear rate = 0.1 Pa, u* = sqrt(tau/rho) = 0.01 m/s; both grow with the flow."""
    acting = {"force": [2.0, 0.0, 1.0], "torque": [0.0, 4.0, 0.0]}
    values: Any = with_loads(in_si(loads(QUARTZ), 4.0), acting)
    flow = [values[name] for name in ("shear_rate", "bed_stress", "shear_velocity")]
    assert flow == pytest.approx([400.0, 0.4, 0.02], rel=1e-6)
    assert values["force"] == pytest.approx([5e-6, 0.0, 2.5e-6])
    assert values["torque"] == pytest.approx([0.0, 5e-9, 0.0])
    text = "\n".join(si_lines(values))
    assert "nominal diameter [m] 0.001   shear rate [1/s] 400" in text
    assert "force (5e-06, 0, 2.5e-06) N" in text
    assert in_si(loads(QUARTZ.partition("[units]")[0], overrides=["fluid.reynolds=1"])) is None


def test_the_velocity_of_a_log_law_is_the_shear_velocity() -> None:
    """A stress of 1000 x 0.02^2 Pa, over 1650 x 9.81 x 1 mm; u* d/nu = 20; forces over that stress x (0.5 mm)^2."""
    text = QUARTZ.replace("shear_rate = 100.0\n", "velocity = 0.02\n")
    scene = loads(text, overrides=["flow={kind='log-law'}"])
    numbers, values = Setup(scene).numbers, in_si(scene)
    assert numbers.shields == pytest.approx(0.4 / (1650.0 * 9.81 * 1e-3))
    assert numbers.shear_reynolds == pytest.approx(20.0)
    assert values is not None and "velocity" not in values
    stresses = values["bed_stress"], values["shear_velocity"], values["units"]["force"]
    assert stresses == pytest.approx((0.4, 0.02, 1e-7))


def test_a_flow_has_a_velocity_and_in_2d_a_disc_of_equal_area() -> None:
    """A rectangle of area 1 has the diameter sqrt(4/pi); Re by the height of the domain, 0.02 m/s x 6 L0/1e-6."""
    text = QUARTZ.replace("width = 16.0\n", "").replace("shear_rate = 100.0\n", "")
    text = text.replace('"sphere"\ndiameter = 2.0', '"rectangle"\nwidth = 2.0\nheight = 0.5')
    flow = ["flow={kind='open-channel', velocity=2.0}", "units.velocity=0.02"]
    scene: Any = loads(text, overrides=['fluid.scale="flow"', "domain.height=6.0", *flow])
    length = 1e-3 / np.sqrt(4.0 / np.pi)
    # The force is per metre of depth.
    scales = (scene.scales.length, scene.scales.velocity, scene.scales.force)
    assert scales == pytest.approx((length, 0.01, 1000.0 * 1e-4 * length))
    assert scene.fluid.reynolds == pytest.approx(0.02 * 6.0 * length / 1e-6)
    assert scene.gravity.acceleration == pytest.approx(9.81 * (length / 0.01) ** 2 / length)


@pytest.mark.parametrize(
    ("override", "said"),
    [
        ("fluid.reynolds=3", "fluid.reynolds: is 3, but [units] makes it 100; leave it out"),
        (
            "gravity.acceleration=9.81",
            "gravity.acceleration: is 9.81, but [units] makes it 0.4905; leave it out",
        ),
        ("body.mass=2", "body.mass: is given with [units]; leave one of them out"),
        ("units.velocity=1", 'units.velocity: is not of the flow "shear"; give shear_rate only'),
        (
            "flow={kind='uniform'}",
            'units.velocity: is missing, which the flow "uniform" needs; add it',
        ),
        ("units.diameter=-1", "units.diameter: is -1; give a number greater than 0"),
        ("units.length=mm", "units.length: is given with diameter; give one of them"),
        ("units.length=inch", 'units.length: is "inch"; give a number or use "um", "mm"'),
        ("units.length=-1", "units.length: is -1; give a number greater than 0"),
        ("units.grain=1", "units.grain: unknown key"),
        ("domain.length=-1", "domain.length: is -1; give a number greater than 0"),
    ],
)
def test_wrong_units_are_refused(override: str, said: str) -> None:
    assert said in message(lambda: loads(QUARTZ, overrides=[override]))


BOX = QUARTZ.replace('"sphere"\ndiameter = 2.0', '"mesh"\nfile = "stone.stl"')
NOMINAL = (12.0 / np.pi) ** (1.0 / 3.0)


@pytest.fixture
def stone(tmp_path: Path) -> Path:
    """The directory of a file with a box of 2 x 1 x 1: volume 2, diagonal sqrt(6)."""
    trimesh.creation.box((2.0, 1.0, 1.0)).export(tmp_path / "stone.stl")
    return tmp_path


@pytest.mark.parametrize(("length", "metres"), [("mm", 1e-3), ("0.002", 2e-3)])
def test_a_unit_of_length_makes_files_in_millimetres_what_they_are(
    length: str, metres: float, stone: Path
) -> None:
    """Nominal diameter (6 x 2/pi)^(1/3); T0 = 0.5/100 s, gravity g T0^2/L0."""
    text = BOX.replace("diameter = 1e-3\n", "")
    scene: Any = loads(text, stone, [f"units.length={length}"])
    values: Any = in_si(scene)
    lengths = (scene.scales.length, values["nominal_diameter"])
    assert lengths == pytest.approx((metres, metres * NOMINAL), rel=1e-6)
    assert scene.gravity.acceleration == pytest.approx(9.81 * 0.005**2 / metres)
    assert loads(dumps(scene)) == scene
    said = f"grain: largest diameter 2.44949, nominal {NOMINAL:.6g}; one unit of length is {metres:g} m"
    assert said in make_plan(scene).text()


def test_a_scanned_grain_in_units_settles_once(
    stone: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Settling takes most of the time of a scan's plan; the scene without its units needs no place."""
    calls, once = [], grains.settle
    monkeypatch.setattr(grains, "settle", lambda *a, **k: calls.append(a) or once(*a, **k))
    assert loads(BOX, stone, ["body.settle=true"]).placement is not None and len(calls) == 1


def test_the_plan_says_what_size_the_file_of_a_grain_has(stone: Path) -> None:
    said = make_plan(loads(BOX, stone, ["body.size=22.0"])).text()
    nominal = 22.0 / np.sqrt(6.0) * NOMINAL
    assert f"largest diameter 22, nominal {nominal:.6g}; by its file 2.44949" in said
