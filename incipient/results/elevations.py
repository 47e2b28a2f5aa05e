"""Elevations of a free surface over time, and the differences between two runs, as data."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Floats


@dataclass(frozen=True, eq=False)
class Elevations:
    """Elevations at the stations over time."""

    times: Floats  # (n,), ascending, from the start or the checkpoint
    values: Floats  # (n, stations)
    largest: float  # largest absolute elevation on the surface within these times

    @classmethod
    def of(cls, readings: list[ElevationReading]) -> Elevations:
        """The elevations of one or more readings."""
        times, values = (
            np.array(part) for part in zip(*((r.time, r.values) for r in readings), strict=True)
        )
        return cls(
            times, values.reshape(len(readings), -1), max(reading.largest for reading in readings)
        )

    @property
    def step(self) -> float:
        """The mean time step; zero for a single time."""
        return float((self.times[-1] - self.times[0]) / max(len(self.times) - 1, 1))

    @property
    def sharpness(self) -> float:
        """Largest second difference in time over the largest value; about (w dt)^2 for a wave."""
        largest = float(np.abs(self.values).max(initial=0.0))
        bent = float(np.abs(np.diff(self.values, 2, axis=0)).max(initial=0.0))
        return bent / largest if largest > 0.0 else 0.0

    def apart(self, other: Elevations) -> Floats:
        """(stations,) largest differences from another run at the times of the run with fewer of them.

        The other run is interpolated by a cubic spline. Zero without common times.
        """
        few, many = sorted((self, other), key=lambda one: len(one.times))
        slack = 1e-9 * (many.times[-1] - many.times[0])
        common = (few.times >= many.times[0] - slack) & (few.times <= many.times[-1] + slack)
        if not common.any():
            return np.zeros(few.values.shape[1])
        return np.abs(few.values[common] - many.at(few.times[common])).max(axis=0)

    def apart_at_the_end(self, other: Elevations) -> Floats:
        """(stations,) differences from another run at the last time of each."""
        return np.abs(self.values[-1] - other.values[-1])

    def at(self, times: Floats) -> Floats:
        """(k, stations) interpolated elevations at times (k,) of the run."""
        if len(self.times) == 1:
            return np.repeat(self.values, len(times), axis=0)
        from scipy.interpolate import CubicSpline

        return np.asarray(CubicSpline(self.times, self.values)(times))


@dataclass(frozen=True)
class ElevationReading:
    """Elevations at the stations at a time, and the largest absolute elevation on the surface."""

    time: float
    values: list[float]
    largest: float
