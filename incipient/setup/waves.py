"""Second-order Stokes wave on a current, at the inflow of a channel with a free surface."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq

from ..arrays import Floats
from ..errors import SceneError

if TYPE_CHECKING:
    from .setup import Setup

# Second harmonic over the first from which on a second-order wave has a second crest in its trough.
HIGHEST = 0.25


@dataclass(frozen=True)
class StokesWave:
    """A wave of permanent form on a layer, to second order, relative to a current that carries it along.

    Its first crest enters at x = 0 at t = 0, after a gentle start over two periods. Its mean discharge is zero: a
    uniform current returns what the wave carries between trough and crest. Source: Svendsen (2006), Introduction to
    Nearshore Hydrodynamics, chapter 8, in a frame that moves with the flow. In shear the first harmonic is that of the
    sheared current (see `stokes_wave`), the second that of the mean current.
    """

    amplitude: float  # of the first harmonic of the elevation
    frequency: float  # in the frame of the bed, 2 pi over the period
    number: float  # of waves, 2 pi over the length
    depth: float  # of the still layer
    current: float  # depth-weighted speed of the current (Kirby & Chen)
    surface: float  # speed of the flow on the surface
    # The first harmonic's velocity upwards over that on the surface, by the height above the bottom
    rise: Any

    def begun(self, t: float) -> float:
        return float(1.0 - np.exp(-((t * self.frequency / (2.0 * np.pi)) ** 2)))

    @property
    def second(self) -> float:
        """Amplitude of the bound second harmonic."""
        a, k, sinh = self.amplitude, self.number, np.sinh(self.number * self.depth)
        return float(a**2 * k * (2.0 + 3.0 / sinh**2) / (4.0 * np.tanh(k * self.depth)))

    def elevation(self, x: Floats, t: float) -> Floats:
        """(n,) above the still level at x (n,) along the channel."""
        grown, phase = self.begun(t), self.number * x - self.frequency * t
        return grown * self.amplitude * np.cos(phase) + grown**2 * self.second * np.cos(2.0 * phase)

    def velocity(self, x: Floats, y: Floats, t: float) -> tuple[Floats, Floats]:
        """(n,) along the channel and (n,) upwards, relative to the current, at heights y above the bottom."""
        a, k, H, grown, y = (
            self.amplitude,
            self.number,
            self.depth,
            self.begun(t),
            np.maximum(y, 0.0),
        )
        phase, whole = k * x - self.frequency * t, 1.0 - np.exp(-2.0 * k * H)
        first, own = (
            grown * a * (self.frequency - k * self.surface),
            self.frequency - k * self.current,
        )
        second = grown**2 * 6.0 * a**2 * own * k * np.exp(-2.0 * k * H) / whole**4
        up, down = np.exp(2.0 * k * (y - H)), np.exp(-2.0 * k * (y + H))
        back = 0.5 * grown * a * first / (k * H) * self.rise(H, 1)
        along = first / k * self.rise(y, 1) * np.cos(phase) + second * (up + down) * np.cos(
            2.0 * phase
        )
        upwards = first * self.rise(y) * np.sin(phase) + second * (up - down) * np.sin(2.0 * phase)
        return along - back, upwards


def stokes_wave(
    amplitude: float,
    frequency: float,
    depth: float,
    gravity: float,
    speed: Callable[[Floats], Floats],
) -> StokesWave:
    """The wave of a frequency in the frame of the bed that propagates with a current, faster than that.

    With U(y) the flow's `speed` at heights (n,) above the bottom, and c = w/k, the velocity upwards solves Rayleigh's
    equation (U - c) (f'' - k^2 f) = U'' f, f(0) = 0, with (U - c)^2 f' = ((U - c) U' + g) f on the surface. A uniform
    flow has (w - k U)^2 = g k tanh(k H) and f = sinh(k y). The mean speed of the current is weighted by 2 k cosh(2 k
    y)/sinh(2 k H) (Kirby & Chen 1989, J. Geophys. Res. 94, 1013).
    """
    y = np.linspace(0.0, depth, 201)
    profile = CubicSpline(y, speed(y))
    fastest, surface = float(profile(y).max()), float(profile(depth))

    def shape(k: float) -> tuple[Floats, Floats]:
        def slopes(height: float, f: Floats) -> list[float]:
            return [f[1], (k**2 + profile(height, 2) / (profile(height) - frequency / k)) * f[0]]

        solution = solve_ivp(
            slopes, (0.0, depth), [0.0, k], t_eval=y, rtol=1e-10, atol=1e-12, method="DOP853"
        ).y
        return solution[0] / solution[0, -1], solution[1] / solution[0, -1]

    def missed(k: float) -> float:
        relative = frequency / k - surface
        return float(relative**2 * shape(k)[1][-1] + relative * profile(depth, 1) - gravity)

    longest = frequency / (fastest + 1.01 * np.sqrt(gravity * depth))
    shortest = frequency**2 / gravity + frequency / np.sqrt(gravity * depth)
    shortest = min(shortest, (1.0 - 1e-6) * frequency / fastest) if fastest > 0.0 else shortest
    k = float(brentq(missed, longest, shortest, xtol=1e-14 * shortest))
    weight = np.exp(2.0 * k * (y - depth)) + np.exp(-2.0 * k * (y + depth))
    felt, whole = (
        float(CubicSpline(y, integrand).integrate(0.0, depth))
        for integrand in (profile(y) * weight, weight)
    )
    return StokesWave(
        amplitude, frequency, k, depth, felt / whole, surface, CubicSpline(y, shape(k)[0])
    )


def wave_of(setup: Setup) -> StokesWave | None:
    """The wave at the inflow of a channel, or None. Raises SceneError if it is too high for second order."""
    settings, base_flow = setup.surface.wave, setup.base_flow
    if settings is None:
        return None
    gravity = float(abs(setup.scene.gravity_vector[setup.scene.up]))

    def speed(y: Floats) -> Floats:
        places = base_flow.column(setup.scene.domain.entrance, base_flow.datum + y)
        return np.asarray(base_flow.velocity(places, 0.0)[0])

    wave = stokes_wave(
        settings.amplitude, 2.0 * math.pi / settings.period, base_flow.depth, gravity, speed
    )
    if wave.second > HIGHEST * wave.amplitude:
        raise SceneError(
            f"surface.wave: its second harmonic is {wave.second / wave.amplitude:.2g} of the first, more than "
            f"{HIGHEST:g}: give a smaller amplitude or period"
        )
    return wave
