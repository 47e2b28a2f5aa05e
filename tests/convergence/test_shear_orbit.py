"""An ellipse that turns in creeping shear flow, against Jeffery's orbit.

Source: G. B. Jeffery, Proc. R. Soc. Lond. A 102 (1922) 161. In unbounded shear u = G y an ellipse of aspect ratio r
whose major axis makes the angle phi with the y axis turns at G/(r^2 + 1) (r^2 cos^2 phi + sin^2 phi); once round takes
2 pi (r + 1/r)/G. In a wide box on whose sides the shear is undisturbed the rest of the error is that of the box: the
disturbance decays as 1/R^2 and so does what the box sends back.
"""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from floating import box_around, floating
from scipy.interpolate import CubicSpline

import incipient
from incipient.fluid import Prescribed
from incipient.geometry.placement import Placement
from incipient.geometry.plane.grains import Ellipse
from incipient.scene import Domain, ExpressionFlow, Fluid, Numerics, Output, Scene, Time
from incipient.scene import Ellipse as EllipseSection

SIDES = ("left", "right", "bottom", "top")
# Viscosity takes the flow to rest with its boundaries within a step, however wide the box.
CREEPING = 1e-10


def jeffery_rate(ratio: float, angle: float) -> float:
    """Clockwise rate at an angle from the y axis, for G = 1."""
    return float((ratio**2 * np.cos(angle) ** 2 + np.sin(angle) ** 2) / (ratio**2 + 1))


def rate(ratio: float, angle: float, half_width: float) -> float:
    """Clockwise rate of a massless ellipse, its centre held in the middle of a box."""
    ellipse, placement = Ellipse((ratio, 1.0)), Placement((0.0, 0.0), np.pi / 2 - angle)
    low, high = (-half_width, -half_width), (half_width, half_width)
    domain = box_around(ellipse, placement, 0.12, half_width / 5, low, high)
    shear = [Prescribed(name, lambda x, t: np.vstack([x[1], 0 * x[0]])) for name in SIDES]
    with floating(
        domain, ellipse, placement, shear, CREEPING, free=(False, False, True), with_inertia=False
    ) as found:
        _, readings = found.march(1e-4, 1e-4)
    return -float(readings[-1, 2])


@pytest.mark.parametrize(
    ("angle", "ratio"),
    [
        *((angle, 3.0) for angle in (0.0, 0.7, 1.2, np.pi / 2)),
        (0.7, 2.0),
        *(pytest.param(angle, 2.0, marks=pytest.mark.slow) for angle in (0.0, 1.2, np.pi / 2)),
    ],
)
def test_rate_in_a_wide_box(angle: float, ratio: float) -> None:
    """Extrapolated from boxes of ten and twenty lengths; within 0.1% of the fastest rate."""
    near, far = (rate(ratio, angle, width * ratio) for width in (10.0, 20.0))
    expected, fastest = jeffery_rate(ratio, angle), jeffery_rate(ratio, 0.0)
    print(ratio, angle, expected, near, far, (4 * far - near) / 3)
    assert (4 * far - near) / 3 == pytest.approx(expected, abs=1e-3 * fastest)
    assert abs(far - expected) < max(0.5 * abs(near - expected), 1e-3 * fastest)


def period(ratio: float, half_width: float, step: float, directory: Path) -> float:
    """Time that a massless ellipse takes to turn once, through as many meshes as that needs."""
    scene = Scene(
        domain=Domain(
            length=2 * half_width,
            height=2 * half_width,
            origin=(-half_width, -half_width),
            top="stream",
        ),
        fluid=Fluid(reynolds=1e-8, scale="grain", inertia=False),
        flow=ExpressionFlow(components=("y", "0")),
        body=EllipseSection(
            semi_axes=(ratio, 1.0),
            centre=(0.0, 0.0),
            angle=90.0,
            motion="free",
            mass=0.0,
            inertia=0.0,
            locked=("x", "y"),
        ),
        time=Time(end=1.06 * 2 * np.pi * (ratio + 1 / ratio), step=step, start="stokes"),
        numerics=Numerics(mesh_size=1.5),
        output=Output(fields=False),
    )
    incipient.run(scene, directory)
    with (directory / "history.csv").open(newline="") as file:
        rows = [
            (float(row["time"]), np.pi / 2 - float(row["angle"]), int(row["meshes"]))
            for row in csv.DictReader(file)
        ]
    time, turned, meshes = np.array(rows).T
    assert meshes[-1] >= 3
    k = int(np.searchsorted(turned, 2 * np.pi))
    return float(CubicSpline(turned[k - 3 : k + 3], time[k - 3 : k + 3])(2 * np.pi))


@pytest.mark.slow
@pytest.mark.parametrize("ratio", [2.0, 3.0])
def test_period_of_the_orbit(ratio: float, tmp_path: Path) -> None:
    """Extrapolated from channels of 20 and 40 semi-axes half width, in which the shear leaves freely."""
    widths = (10.0 * ratio, 20.0 * ratio)
    near, far = (period(ratio, width, 0.1, tmp_path / f"{width}") for width in widths)
    expected = 2 * np.pi * (ratio + 1 / ratio)
    print(
        ratio,
        expected,
        near / expected - 1,
        far / expected - 1,
        (4 * far - near) / 3 / expected - 1,
    )
    assert (4 * far - near) / 3 == pytest.approx(expected, rel=0.01)
