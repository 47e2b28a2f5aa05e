"""Rotating bodies against exact paths."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from domains import SIDES, ring
from floating import box_around, floating
from scenes import ran
from scipy.interpolate import CubicSpline

from incipient.arrays import Floats
from incipient.fluid import Prescribed
from incipient.geometry.placement import Placement
from incipient.geometry.plane.grains import Disc, Ellipse
from incipient.scene import Domain, ExpressionFlow, Fluid, Numerics, Output, Scene, Time
from incipient.scene import Ellipse as EllipseSection

# A disc that turns in an annulus full of fluid, against the exact solution.
#
# Source: the azimuthal velocity v(r, t) between concentric circles obeys dv/dt = nu (v'' + v'/r - v/r^2), the couple
# on the inner one is 2 pi a^2 nu (v' - v/r) there, and J d(spin)/dt = couple (Batchelor, An Introduction to Fluid
# Dynamics, section 4.5). Without inertia the couple vanishes. It was solved by Chebyshev collocation in r (degree 28)
# and Radau's method in t, to eight digits, independently of the program (`exact_spins` here at commit 14644ea5).


INNER, OUTER, VISCOSITY, END = 0.5, 1.0, 0.1, 0.8
TURNS_ONLY = (False, False, True)


def at_rest(t: float) -> float:
    return 0.0


def ramp(t: float) -> float:
    """From zero to one until t = 0.4, twice differentiable."""
    s = np.clip(t / 0.4, 0.0, 1.0)
    return float(s**3 * (10 - 15 * s + 6 * s**2))


# Exact spins at TIMES, by moment of inertia: let go with a spin of one in fluid and an outer circle at rest, and from
# rest where the outer circle turns with `ramp`.
TIMES = np.array([0.4, 0.6, 0.8])
RELEASED = {
    0.02: (0.0286369883, 0.0182149583, 0.0121443286),
    1.0: (0.7687012547, 0.7074160834, 0.6542817749),
}
CARRIED = {
    0.0: (0.0748973260, 0.3056496906, 0.5286344519),
    0.02: (0.0610547301, 0.2707943318, 0.4899159107),
    1.0: (0.0056459741, 0.0355935956, 0.0860749766),
}


# -- the program's ------------------------------------------------------------------------------


def readings(
    inertia: float,
    spin: float,
    wall: Callable[[float], float],
    step: float,
    end: float = END,
    free: tuple[bool, bool, bool] = TURNS_ONLY,
    around: int = 64,
) -> Floats:
    """Velocities and places (steps + 1, 6) of the disc."""

    def turning(x: Floats, t: float) -> Floats:
        return wall(t) * np.vstack([-x[1], x[0]])

    domain, centre = ring(INNER, OUTER, around, order=2), Placement((0.0, 0.0))
    with floating(
        domain,
        Disc(2 * INNER),
        centre,
        [Prescribed("outer", turning)],
        1 / VISCOSITY,
        mass=np.pi * INNER**2,
        inertia=inertia,
        free=free,
        velocities=(0.0, 0.0, spin),
        boundary="inner",
    ) as result:
        steps, values = result.march(end, step)
    if step < 0.1:
        assert max(taken.report.corrected for taken in steps) <= 3
    return values


def errors(
    inertia: float, spin: float, wall: Callable[[float], float], exact: tuple[float, ...]
) -> Floats:
    """Largest errors of the spin at TIMES for steps of 1/20, 1/40, 1/80."""
    spins = {count: readings(inertia, spin, wall, 1 / count)[:, 2] for count in (20, 40, 80)}
    places = {count: np.round(TIMES * count).astype(int) for count in spins}
    return np.array([np.abs(result[places[n]] - exact).max() for n, result in spins.items()])


@pytest.mark.parametrize("inertia", [0.02, pytest.param(1.0, marks=pytest.mark.slow)])
def test_released_with_a_spin(inertia: float) -> None:
    """The spin jumps against fluid at rest and decays: second order after the jump all the same."""
    result = errors(inertia, 1.0, at_rest, RELEASED[inertia])
    assert result[-1] < 2e-5
    assert result[0] / result[-1] > 10.0


def test_without_inertia_a_spin_is_gone_at_once() -> None:
    """No angular momentum that the fluid could take up; steps are solved to 1e-9."""
    assert np.abs(readings(0.0, 1.0, at_rest, 0.1)[1:, 2]).max() < 1e-9


@pytest.mark.parametrize(
    "inertia", [0.0, *(pytest.param(one, marks=pytest.mark.slow) for one in (0.02, 1.0))]
)
def test_carried_along_by_the_outer_circle(inertia: float) -> None:
    result = errors(inertia, 0.0, ramp, CARRIED[inertia])
    assert result[-1] < 5e-4
    assert np.log2(result[:-1] / result[1:]) == pytest.approx([2.0, 2.0], abs=0.15)


# An ellipse that turns in creeping shear flow, against Jeffery's orbit.
#
# Source: G. B. Jeffery, Proc. R. Soc. Lond. A 102 (1922) 161. In unbounded shear u = G y an ellipse of aspect ratio
# r whose major axis makes the angle phi with the y axis turns at G/(r^2 + 1) (r^2 cos^2 phi + sin^2 phi); once
# round takes 2 pi (r + 1/r)/G. In a wide box on whose sides the shear is undisturbed the rest of the error is that
# of the box: the disturbance decays as 1/R^2 and so does what the box sends back.


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
    shear = [Prescribed(name, lambda x, t: np.vstack([x[1], 0 * x[0]])) for name in SIDES[:4]]
    with floating(
        domain, ellipse, placement, shear, CREEPING, free=(False, False, True), with_inertia=False
    ) as result:
        _, readings = result.march(1e-4, 1e-4)
    return -float(readings[-1, 2])


@pytest.mark.parametrize(
    ("angle", "ratio"),
    [
        *((angle, 3.0) for angle in (0.0, np.pi / 2)),
        (0.7, 2.0),
        *(pytest.param(angle, 3.0, marks=pytest.mark.slow) for angle in (0.7, 1.2)),
        *(pytest.param(angle, 2.0, marks=pytest.mark.slow) for angle in (0.0, 1.2, np.pi / 2)),
    ],
)
def test_rate_in_a_wide_box(angle: float, ratio: float) -> None:
    """Extrapolated from boxes of ten and twenty lengths; within 0.1% of the fastest rate."""
    near, far = (rate(ratio, angle, width * ratio) for width in (10.0, 20.0))
    expected, fastest = jeffery_rate(ratio, angle), jeffery_rate(ratio, 0.0)
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
    result = ran(scene, directory)
    time, turned = result["time"], np.pi / 2 - result["angle"]
    assert result["meshes"][-1] >= 3
    k = int(np.searchsorted(turned, 2 * np.pi))
    return float(CubicSpline(turned[k - 3 : k + 3], time[k - 3 : k + 3])(2 * np.pi))


@pytest.mark.slow
@pytest.mark.parametrize("ratio", [2.0, 3.0])
def test_period_of_the_orbit(ratio: float, tmp_path: Path) -> None:
    """Extrapolated from channels of 20 and 40 semi-axes half width, in which the shear leaves freely."""
    widths = (10.0 * ratio, 20.0 * ratio)
    near, far = (period(ratio, width, 0.1, tmp_path / f"{width}") for width in widths)
    expected = 2 * np.pi * (ratio + 1 / ratio)
    assert (4 * far - near) / 3 == pytest.approx(expected, rel=0.01)
