"""Waves of finite height against potential theory of second order, and of third order for the frequency."""

from functools import partial

import numpy as np
import pytest
from domains import rectangle
from mpi4py import MPI
from scipy.optimize import curve_fit
from waves import tank

from incipient.mesh.domain import build
from incipient.meshes.model import meshed

LENGTH = 2.0  # half of a wave, on water of depth one; gravity one
K = np.pi / LENGTH
LINEAR = np.sqrt(K * np.tanh(K))  # frequency of small waves
VISCOSITY = 1e-5


def second_order(t, k=K, lasting=False):
    """The part q(t) a^2 cos 2kx of the elevation, a cos kx at first, of inviscid water released from rest.

    Derived here: with a cos kx cos wt and its potential in the conditions on the surface up to their second order,
    b(t) a^2 cos 2kx for the potential's part on the still level,

        q' - 2k tanh(2k) b = -(g k^2/2w) sin 2wt,
        b' + g q = w^2 ((1/tanh(k)^2 - 1) sin(wt)^2/4 + cos(wt)^2/2),

    and q = q' = 0 at first. A wave that lasts starts as the particular solution does, which has no frequency but 2w:
    the standing wave of Tadjbakhsh & Keller (1960), J. Fluid Mech. 8, 442.
    """
    w, own = np.sqrt(k * np.tanh(k)), 2.0 * k * np.tanh(2.0 * k)
    part = (1.0 / np.tanh(k) ** 2 - 1.0) / 8.0
    steady = w**2 * (part + 0.25)
    swinging = (own * w**2 * (0.25 - part) - k**2) / (own - 4.0 * w**2)
    found = steady + swinging * np.cos(2.0 * w * t)
    return found if lasting else found - (steady + swinging) * np.cos(np.sqrt(own) * t)


def test_the_second_order_of_a_standing_wave_in_deep_water():
    """(k/2) cos(wt)^2 (Rayleigh 1915), with k = 10 on a depth of one to eight digits."""
    t = np.linspace(0.0, 3.0, 31)
    deep = 5.0 * np.cos(np.sqrt(10.0) * t) ** 2
    assert second_order(t, k=10.0, lasting=True) == pytest.approx(deep, abs=1e-6)


def third_order(amplitude):
    """The frequency of a standing wave whose elevation has the part a cos kx cos wt: Tadjbakhsh & Keller (1960)."""
    w = np.sqrt(np.tanh(K))
    shift = (9.0 * w**-7 - 12.0 * w**-3 - 3.0 * w - 2.0 * w**5) / 32.0
    return LINEAR * (1.0 + 0.5 * (K * amplitude) ** 2 * shift / w)


def elevations(amplitude, lasting=False, columns=12, steps=200, periods=1.0, order=3):
    """Times and elevations (times, 2) at the ends of a tank, released from rest."""
    grid = rectangle((0.0, 0.0), LENGTH, 1.0, columns, columns // 2)
    domain = build(MPI.COMM_WORLD, partial(meshed, grid, order=order))

    def first(x):
        second = (
            amplitude**2 * second_order(0.0, lasting=True) * np.cos(2.0 * K * x[:, 0])
            if lasting
            else 0.0
        )
        return amplitude * np.cos(K * x[:, 0]) + second

    with tank(domain, VISCOSITY, first, order=order, tolerance=1e-8) as made:
        x = made.points[:, 0]
        ends, told = [int(np.argmin(x)), int(np.argmax(x))], []
        length = 2.0 * np.pi / LINEAR / steps
        for step in made.transient.march(periods * steps * length, length):
            told.append((step.time, *made.elevation()[ends]))
    t, *h = np.array(told).T
    return t, np.array(h).T


@pytest.mark.slow
def test_the_second_order_of_a_wave_released_from_rest():
    """The mean of both ends has even orders only; what linear and second order leave of one end is of third order."""
    amplitudes = (0.05, 0.1)
    t, linear = elevations(1e-5)
    exact, largest = second_order(t), np.abs(second_order(t)).max()
    found, rests = [], []
    for a in amplitudes:
        _, h = elevations(a)
        found.append(h.mean(axis=1) / a**2)
        rests.append(np.abs(h[:, 0] - a / 1e-5 * linear[:, 0] - a**2 * exact).max())
    small, large = (np.abs(one - exact).max() / largest for one in found)
    assert small < 0.02 and large < 0.05
    # Without the fourth order; a backward difference of second order loses (2w dt)^2/3 of the phase, 0.4% of it here.
    assert np.abs((4.0 * found[0] - found[1]) / 3.0 - exact).max() < 0.01 * largest
    assert 2.8 < np.log2(rests[1] / rests[0]) < 3.2


@pytest.mark.slow
def test_the_frequency_of_a_standing_wave_of_finite_height():
    """That of third order, within a tenth of how far it is below the linear one, up to a height of 0.3 of the depth."""

    def wave(t, first, frequency, third, decay):
        return np.exp(-decay * t) * (
            first * np.cos(frequency * t) + third * np.cos(3.0 * frequency * t)
        )

    def frequency(a):
        t, h = elevations(a, lasting=True, steps=100, periods=2.0)
        odd = 0.5 * (h[:, 0] - h[:, 1]) / a
        return curve_fit(wave, t, odd, [1.0, LINEAR, 0.0, 0.0])[0][:2]

    linear = frequency(1e-4)[1]
    for a in (0.1, 0.2, 0.3):
        first, found = frequency(a)
        shift = third_order(first * a) / LINEAR - 1.0
        # Theory of third order leaves out terms of fifth, of relative size (k a)^2.
        assert found / linear - 1.0 == pytest.approx(shift, rel=0.1)
