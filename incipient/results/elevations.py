"""Elevations of a free surface in the course of a run, and how far those of two runs are apart, as data."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Floats


@dataclass(frozen=True, eq=False)
class Elevations:
    """Elevations at the stations in the course of a run."""

    times: Floats  # (n,), ascending; that of the start is the first, of a resumed run that of its checkpoint
    values: Floats  # (n, stations)
    largest: float  # the largest size of an elevation anywhere on the surface within these times

    @classmethod
    def of(cls, readings: list[ElevationReading]) -> Elevations:
        """What has been read, of which there is one at least."""
        times, values = (
            np.array(part) for part in zip(*((r.time, r.values) for r in readings), strict=True)
        )
        return cls(
            times, values.reshape(len(readings), -1), max(reading.largest for reading in readings)
        )

    @property
    def step(self) -> float:
        """The mean time step; zero where there is none."""
        return float((self.times[-1] - self.times[0]) / max(len(self.times) - 1, 1))

    @property
    def sharpness(self) -> float:
        """The largest second difference from time to time over the largest value; of a wave about (w dt)^2."""
        largest = float(np.abs(self.values).max(initial=0.0))
        bent = float(np.abs(np.diff(self.values, 2, axis=0)).max(initial=0.0))
        return bent / largest if largest > 0.0 else 0.0

    def apart(self, other: Elevations) -> Floats:
        """(stations,) the largest distances from those of another run, at the times of the one with fewer of them.

        The other's are a cubic spline between its times. Zero where there are no common times.
        """
        few, many = sorted((self, other), key=lambda one: len(one.times))
        slack = 1e-9 * (many.times[-1] - many.times[0])
        common = (few.times >= many.times[0] - slack) & (few.times <= many.times[-1] + slack)
        if not common.any():
            return np.zeros(few.values.shape[1])
        return np.abs(few.values[common] - many.at(few.times[common])).max(axis=0)

    def apart_at_the_end(self, other: Elevations) -> Floats:
        """(stations,) the distances from those of another run at the last time of each."""
        return np.abs(self.values[-1] - other.values[-1])

    def at(self, times: Floats) -> Floats:
        """(k, stations) elevations at times (k,) within those of the run."""
        if len(self.times) == 1:
            return np.repeat(self.values, len(times), axis=0)
        from scipy.interpolate import CubicSpline

        return np.asarray(CubicSpline(self.times, self.values)(times))


@dataclass(frozen=True)
class ElevationReading:
    """Elevations at the stations at a time, and the largest size of one anywhere on the surface."""

    time: float
    values: list[float]
    largest: float
