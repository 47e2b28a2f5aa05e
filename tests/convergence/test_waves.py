"""Waves against potential flow, and the errors of their runs."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
from domains import curved_box, rectangle
from mpi4py import MPI
from scenes import REFERENCE, TANK, rows_of
from scipy.optimize import curve_fit
from waves import Mode, prosperetti, tank

import incipient
from incipient.arrays import Floats
from incipient.coupled.remeshing import Projection
from incipient.mesh.domain import build
from incipient.meshes.model import meshed
from incipient.results.loads import Elevations
from incipient.scene.file import loads

# Waves against exact solutions: modes of viscous layers, in time and space, in the plane and in space.


def test_the_modes_are_those_of_the_table():
    for row in rows_of(REFERENCE / "viscous_wave_modes.csv"):
        nu, k, re_s, im_s = (float(row[name]) for name in ("nu", "k", "re_s", "im_s"))
        assert Mode(nu, k).s == pytest.approx(re_s + 1j * im_s, rel=1e-8)


AMPLITUDE = 1e-7


def error_of_a_mode(mode, gdim=2, n=8, order=2, steps=40, periods=1.0):
    """The largest error of the elevation over its amplitude, started as the mode is.

    In 3-D waves are in two directions: a mode of cos(k x) cos(k y) is one of the wave number sqrt(2) k.
    """
    across = gdim - 1
    k = mode.k / np.sqrt(across)

    def shape(x):
        return np.cos(k * x[:, :across]).prod(axis=1)

    def velocity(x):
        along, upwards = (part.real for part in mode.velocity(x[:, 0], x[:, across]))
        slopes = [np.tan(k * x[:, i]) * shape(x) for i in range(across)]
        parts = [along / np.sqrt(across) * slope for slope in slopes]
        return AMPLITUDE * np.column_stack([*parts, upwards * shape(x)])

    def elevation(x):
        return AMPLITUDE * shape(x)

    gravity = (*[0.0] * across, -mode.g)
    with tank(curved_box(gdim, n, order), mode.nu, elevation, order=order, gravity=gravity) as made:
        made.flow(velocity)
        end, errors = periods * mode.period, []
        for step in made.transient.march(end, end / steps):
            exact = np.real(np.exp(mode.s * step.time)) * shape(made.points)
            errors.append(np.abs(made.elevation() / AMPLITUDE - exact).max())
            assert abs(made.surface.volume()) < 1e-12 * AMPLITUDE
    return max(errors)


def test_a_viscous_mode_is_of_second_order_in_time():
    mode = Mode(0.01, np.pi)
    coarse, fine = (error_of_a_mode(mode, n=6, order=3, steps=steps) for steps in (20, 40))
    # A backward difference of second order shifts the phase by (w dt)^2/3 of it in each step: (2 pi)^3/(3 steps^2).
    assert fine < (2 * np.pi) ** 3 / 3 / 40**2
    # Found: 3.69; the next term of the error is of third order and still 8% of it at twenty steps.
    assert coarse / fine == pytest.approx(4.0, rel=0.15)


def test_a_viscous_mode_is_of_third_order_in_space():
    """In elements of order three, the default: the pressure's order limits that of the elevation at single nodes."""
    mode = Mode(0.05, np.pi)
    coarse, fine = (error_of_a_mode(mode, n=n, order=3, steps=300, periods=0.25) for n in (3, 6))
    assert np.log2(coarse / fine) > 3.0


def test_waves_in_two_directions():
    """Order two is one of two in space."""
    mode = Mode(0.05, np.sqrt(2.0) * np.pi)
    coarse, fine = (
        error_of_a_mode(mode, gdim=3, n=n, steps=steps, periods=0.25)
        for n, steps in ((3, 10), (5, 20))
    )
    assert fine < 0.015
    assert coarse / fine > (5 / 3) ** 1.8


@pytest.mark.parametrize(("gravity", "pinned"), [(1.0, False), (30.0, True)])
def test_steps_by_blocks_are_those_by_factors(gravity, pinned):
    """In space: three steps to a tolerance of 1e-9 each, below a surface of some slope."""
    computed, projected = [], []
    for solver in ("direct", "block"):
        with tank(
            curved_box(3, 3, 2),
            0.01,
            lambda x: 0.1 * np.cos(np.pi * x[:, 0]) * np.cos(np.pi * x[:, 1]),
            gravity=(0.0, 0.0, -gravity),
            pinned=pinned,
            tolerance=1e-9,
            solver=solver,
        ) as made:
            for _ in range(3):
                made.transient.advance(0.1)
            computed.append(made.elevation())
            assert abs(made.surface.volume()) < 1e-16
            statistics, space = made.fluid.solver.statistics, made.fluid.space
            x = space.velocity_points()
            made.fluid.state.x.array[space.velocity_map[2::3]] += (
                np.prod(x[:, :2] * (1.0 - x[:, :2]), axis=1) * x[:, 2]
            )
            with Projection(made.fluid) as projection:
                assert projection.apply() > 0.01
            projected.append(made.fluid.state.x.array[space.velocity_map])
    assert computed[1] == pytest.approx(computed[0], abs=1e-8)
    assert projected[1] == pytest.approx(projected[0], abs=1e-7)
    # Without what the surface adds to the pressure's block GMRES does not converge at all.
    assert statistics["krylov_iterations"] < 8 * statistics["solves"]


# Waves of finite height against potential theory of second order, and of third order for the frequency.


LENGTH = 2.0  # half of a wave, on water of depth one; gravity one
K = np.pi / LENGTH
LINEAR = np.sqrt(K * np.tanh(K))  # frequency of small waves
VISCOSITY = 1e-5
# Of the elevation a^2 q(t) cos 2kx beside a cos kx cos wt, q at t = 0 (Tadjbakhsh & Keller 1960, J. Fluid Mech. 8,
# 442): w^2 (c + 1/4) + (2 k tanh(2k) w^2 (1/4 - c) - k^2)/(2 k tanh(2k) - 4 w^2) with c = (1/tanh(k)^2 - 1)/8, k/2 in
# deep water.
SECOND_ORDER = 0.943613512
# What third order adds to the frequency of a cos kx cos wt, over (k a)^2/2 of it (the same paper).
W = np.sqrt(np.tanh(K))
THIRD_ORDER = (9.0 * W**-7 - 12.0 * W**-3 - 3.0 * W - 2.0 * W**5) / 32.0 / W


def elevations(amplitude):
    """Times and elevations (times, 2) at the ends of a tank in two periods of a standing wave, from its highest."""
    domain = build(
        MPI.COMM_WORLD, partial(meshed, rectangle((0.0, 0.0), LENGTH, 1.0, 12, 6), order=3)
    )

    def first(x):
        second = SECOND_ORDER * np.cos(2.0 * K * x[:, 0])
        return amplitude * np.cos(K * x[:, 0]) + amplitude**2 * second

    with tank(domain, VISCOSITY, first, order=3, tolerance=1e-8) as made:
        x = made.points[:, 0]
        ends, told = [int(np.argmin(x)), int(np.argmax(x))], []
        length = 2.0 * np.pi / LINEAR / 100
        for step in made.transient.march(200 * length, length):
            told.append((step.time, *made.elevation()[ends]))
    t, *h = np.array(told).T
    return t, np.array(h).T


@pytest.mark.slow
def test_the_frequency_of_a_standing_wave_of_finite_height():
    """That of third order, within a tenth of how far it is below the linear one, up to a height of 0.3 of the depth."""

    def wave(t, first, frequency, third, decay):
        return np.exp(-decay * t) * (
            first * np.cos(frequency * t) + third * np.cos(3.0 * frequency * t)
        )

    def frequency(a):
        t, h = elevations(a)
        odd = 0.5 * (h[:, 0] - h[:, 1]) / a
        return curve_fit(wave, t, odd, [1.0, LINEAR, 0.0, 0.0])[0][:2]

    linear = frequency(1e-4)[1]
    for a in (0.1, 0.2, 0.3):
        first, computed = frequency(a)
        shift = 0.5 * (K * first * a) ** 2 * THIRD_ORDER
        # Theory of third order leaves out terms of fifth, of relative size (k a)^2.
        assert computed / linear - 1.0 == pytest.approx(shift, rel=0.1)


# Error bars of elevations, and accuracies asked for, against exact linear waves: modes, and a start from rest.


OF_RUNS = 1e-6  # their amplitude
WAVE = f"""\
{TANK}[surface]
elevation = "{OF_RUNS}*cos(pi*x)"
stations = [0.0, 0.3, 1.0]
bottom = "slip"
[time]
end = 4.0
step = 0.05
[numerics]
mesh_size = 8.0
"""
# Two wave numbers deep: tanh(k H) is one to 4e-6, and Prosperetti's solution exact.
DEEP = WAVE.replace("height = 1.0", "height = 2.0").replace(
    "reynolds = 100.0", "reynolds = 200.0"
)  # viscosity 0.01


def true_error(computed: Elevations | None, exact: Floats) -> float:
    """The largest error within the run, over the amplitude; exact (times,) is the elevation at x = 0 over that."""
    shape = np.cos(np.pi * np.array([0.0, 0.3, 1.0]))
    return float(np.abs(computed.values / OF_RUNS - exact[:, None] * shape).max())


COARSE_STEPS = ("time.step=0.1", "numerics.mesh_size=8.0", "numerics.order=3")
SLOW = pytest.mark.slow


def test_error_bars_of_a_wave_released_from_rest() -> None:
    result = incipient.run(loads(DEEP, overrides=COARSE_STEPS))
    bars = result.error_bars
    errors = bars.total.others
    assert [part.name for part in bars.terms[0].parts] == ["time step", "mesh"]
    true = true_error(
        result.elevations, prosperetti(np.maximum(result.elevations.times, 1e-12), 0.01, np.pi)
    )
    assert 0.75 < errors["elevation"].max() / OF_RUNS / true < 3.0
    assert (
        f"within {errors['level'][1]:.1e}, in the run {errors['elevation'][1]:.1e}" in result.text()
    )
    assert (
        bars.to_dict()["force"] is None and bars.to_dict()["terms"][0]["parts"][0]["torque"] is None
    )


@pytest.mark.parametrize(
    "accuracy", [0.1, 0.03, pytest.param(0.003, marks=SLOW), pytest.param(0.001, marks=SLOW)]
)
def test_an_accuracy_of_elevations_is_reached(accuracy: float) -> None:
    result = incipient.run(loads(DEEP, overrides=[f"numerics.accuracy={accuracy}", "time.end=2.0"]))
    assert result.adaptation is not None and result.adaptation.met
    assert result.adaptation.of == "elevation"
    true = true_error(
        result.elevations, prosperetti(np.maximum(result.elevations.times, 1e-12), 0.01, np.pi)
    )
    assert true < min(
        accuracy, result.adaptation.reached
    )  # at 0.1 it was 1.25 to 1.33 times what was estimated
    assert result.adaptation.reached < 1.0001 * accuracy
