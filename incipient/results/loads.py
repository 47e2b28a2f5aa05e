"""Loads on a grain, their coefficients, the gap, and elevations over time."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np

from ..arrays import Floats
from ..scene.messages import counted
from .quantity import AXES, labelled, words_of


class ForceAndTorque:
    """A load (6,), (0,) without a grain."""

    load: Floats

    @property
    def force(self) -> Floats:
        return self.load[:3]

    @property
    def torque(self) -> Floats:
        return self.load[3:]


@dataclass(frozen=True)
class LoadOfFlow:
    """Force or torque of the flow on the grain (3,), scene units with fluid density one.

    flow: without buoyancy, corrected for errors of known sign
    surface_integral: of sigma n or its torque over the surface, a cross-check
    computed: by the residual method, not corrected
    """

    flow: Floats
    surface_integral: Floats
    computed: Floats

    def corrected(self, change: Floats) -> Self:
        return replace(self, flow=self.computed + change)


@dataclass(frozen=True)
class Forces(LoadOfFlow):
    """Forces on the grain (3,); buoyancy: of the hydrostatic pressure."""

    derived: ClassVar = ("total",)
    buoyancy: Floats
    weight: Floats

    @property
    def total(self) -> Floats:
        """Flow, buoyancy and weight, the paper's F_flow&g (9)."""
        return self.flow + self.buoyancy + self.weight


@dataclass(frozen=True)
class Torques(LoadOfFlow):
    """Torques on the grain (3,) about a point (3,); in 2-D along the third axis."""

    about: Floats


@dataclass(frozen=True)
class Coefficients:
    """Drag, lift and moment over V^2 A/2 and V^2 A L/2, with the V of the Reynolds number, L the grain's size.

    A is L in 2-D (per unit depth) and pi L^2/4 in 3-D, where the moment is that about the y axis.
    """

    drag: float
    lift: float
    moment: float
    reference_velocity: float
    reference_length: float


@dataclass(frozen=True)
class Gap:
    """Gap between grain and bed in the computed flow.

    closed: the grain touches the bed, and interstices narrower than the width are closed
    """

    derived: ClassVar = ("resolved",)
    width: float
    cells: int
    closed: bool = False

    @property
    def resolved(self) -> bool:
        return self.closed or self.cells >= 2

    def lines(self) -> list[str]:
        if self.closed:
            return labelled("gap", f"closed where it is narrower than {self.width:.4g}")
        refine = "NOT resolved: refine with a smaller numerics.mesh_size"
        state = f"{counted(self.cells, 'cell')} across: {'resolved' if self.resolved else refine}"
        return labelled("gap", f"{self.width:.4g}, {state}") if np.isfinite(self.width) else []


# Components of a load (3,) in 2-D, (6,) in 3-D, in force and torque (6,).
COMPONENTS = {2: [0, 1, 5], 3: [0, 1, 2, 3, 4, 5]}


def whole(load: Floats) -> Floats:
    """Force and torque (6,) of a load (3,) in 2-D, (6,) in 3-D."""
    components = np.zeros(6)
    components[COMPONENTS[2 if len(load) == 3 else 3]] = load
    return components


def named(name: str, vector: Floats, gdim: int) -> dict[str, Any]:
    """Components of a force (3, ...) by column: force_x, force_y, in 3-D also force_z."""
    return {f"{name}_{axis}": vector[place] for place, axis in enumerate(AXES[:gdim])}


def columns_of_load(
    load: Floats, gdim: int, force: str = "force", torque: str = "torque"
) -> dict[str, Any]:
    """Components of a load (6, ...) by column: in 2-D two of force and one of torque."""
    turning = {torque: load[5]} if gdim == 2 else named(torque, load[3:], 3)
    return named(force, load[:3], gdim) | turning


def loads_words(force: Floats, torque: Floats, gdim: int, digits: str = ".6g") -> str:
    """Force and torque (3,) as text."""
    turning = words_of(torque, "torque", gdim, digits)
    return f"{words_of(force, 'force', gdim, digits)}   torque {turning}"


@dataclass(frozen=True, eq=False)
class Elevations:
    """Elevations at the stations over time."""

    times: Floats  # (n,), ascending, from the start or the checkpoint
    values: Floats  # (n, stations)
    largest: float  # largest absolute elevation on the surface within these times

    @property
    def step(self) -> float:
        return float((self.times[-1] - self.times[0]) / max(len(self.times) - 1, 1))

    @property
    def sharpness(self) -> float:
        """Largest second difference in time over the largest value; about (w dt)^2 for a wave."""
        largest = float(np.abs(self.values).max(initial=0.0))
        bent = float(np.abs(np.diff(self.values, 2, axis=0)).max(initial=0.0))
        return bent / largest if largest > 0.0 else 0.0

    def apart(self, other: Elevations) -> Floats:
        """Largest differences (stations,) from another run, by a cubic spline; zero without common times."""
        few, many = sorted((self, other), key=lambda series: len(series.times))
        slack = 1e-9 * (many.times[-1] - many.times[0])
        common = (few.times >= many.times[0] - slack) & (few.times <= many.times[-1] + slack)
        if not common.any():
            return np.zeros(few.values.shape[1])
        return np.abs(few.values[common] - many.at(few.times[common])).max(axis=0)

    def at(self, times: Floats) -> Floats:
        from scipy.interpolate import make_interp_spline

        spline = make_interp_spline(self.times, self.values, min(3, len(self.times) - 1))
        return np.asarray(spline(times))
