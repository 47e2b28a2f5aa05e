"""Stokes's wave of second order on a stream: what a wave maker lets in."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from ..arrays import Floats

# Second harmonic over the first from which on a wave of second order has a second crest in its trough.
HIGHEST = 0.25
HEIGHTS = 200  # at which a stream is looked at


@dataclass(frozen=True)
class StokesWave:
    """A wave of permanent form on a layer, to second order, relative to a stream that carries it along.

    Its first crest enters at x = 0 at t = 0; it begins gently, within two periods. Its mean discharge is zero: a
    uniform current takes back what the wave carries between trough and crest. Source: Svendsen (2006), Introduction to
    Nearshore Hydrodynamics, chapter 8, in a frame that moves with the stream.

    amplitude: of the first harmonic of the elevation
    frequency: in the frame of the bed, 2 pi over the period
    number:    of waves, 2 pi over the length
    depth:     of the still layer
    stream:    speed U of the stream as the wave feels it
    """

    amplitude: float
    frequency: float
    number: float
    depth: float
    stream: float

    def begun(self, t: float) -> float:
        """What there is of the amplitude at a time."""
        return float(1.0 - np.exp(-((t * self.frequency / (2.0 * np.pi)) ** 2)))

    @property
    def second(self) -> float:
        """Amplitude of the second harmonic, which is bound to the first."""
        a, k, sinh = self.amplitude, self.number, np.sinh(self.number * self.depth)
        return float(a**2 * k * (2.0 + 3.0 / sinh**2) / (4.0 * np.tanh(k * self.depth)))

    def elevation(self, x: Floats, t: float) -> Floats:
        """(n,) above the still level at places x (n,) along the stream."""
        grown, phase = self.begun(t), self.number * x - self.frequency * t
        return grown * self.amplitude * np.cos(phase) + grown**2 * self.second * np.cos(2.0 * phase)

    def velocity(self, x: Floats, y: Floats, t: float) -> tuple[Floats, Floats]:
        """(n,) along the stream and (n,) upwards, beside the stream's, at heights y above the bottom."""
        a, k, H, grown = self.amplitude, self.number, self.depth, self.begun(t)
        own = self.frequency - k * self.stream
        phase, whole = k * x - self.frequency * t, 1.0 - np.exp(-2.0 * k * H)
        rise, fall = np.exp(k * (y - H)), np.exp(-k * (y + H))
        first = grown * a * own / whole
        second = grown**2 * 6.0 * a**2 * own * k * np.exp(-2.0 * k * H) / whole**4
        back = grown**2 * a**2 * own / (2.0 * H * np.tanh(k * H))
        along = first * (rise + fall) * np.cos(phase) + second * (rise**2 + fall**2) * np.cos(2.0 * phase)
        upwards = first * (rise - fall) * np.sin(phase) + second * (rise**2 - fall**2) * np.sin(2.0 * phase)
        return along - back, upwards


def stokes_wave(
    amplitude: float, frequency: float, depth: float, gravity: float, speed: Callable[[Floats], Floats]
) -> StokesWave:
    """The wave of a frequency in the frame of the bed that runs with a stream.

    Its number k solves (w - k U)^2 = g k tanh(k H), with U the mean of the stream's `speed`, a function of heights (n,)
    above the bottom, weighted by 2 k cosh(2 k y)/sinh(2 k H): of first order in the shear (Kirby & Chen 1989, J.
    Geophys. Res. 94, 1013), exact where there is none.
    """
    y = depth * (np.arange(HEIGHTS) + 0.5) / HEIGHTS
    profile = np.asarray(speed(y))

    def felt(k: float) -> float:
        weight = np.exp(2.0 * k * (y - depth)) + np.exp(-2.0 * k * (y + depth))
        return float(profile @ weight / weight.sum())

    def missed(k: float) -> float:
        return float(k * felt(k) + np.sqrt(gravity * k * np.tanh(k * depth)) - frequency)

    shortest = frequency**2 / gravity + frequency / np.sqrt(gravity * depth)
    number = float(brentq(missed, 0.0, shortest, xtol=1e-14 * shortest))
    return StokesWave(amplitude, frequency, number, depth, felt(number))
