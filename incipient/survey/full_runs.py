"""Full runs of the flow past grains of a bed: scenes, results of a sweep, and load coefficients.

Units are the grain's diameter d, the shear rate and the fluid's density. Coefficients are force over bed stress and
d^2, and torque over bed stress and d^3.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arrays import Floats
from ..scene import Domain, Effects, Fluid, HeapBed, Numerics, Output, Scene, Shear, Sphere
from ..sweep.cases import identity_of
from .pockets import TOUCHING, Pocket
from .request import Survey

BELOW = 0.1  # diameters of the grain: from it to the base plane at least, and from it to posts that it overhangs
COMPONENTS = ("force_x", "force_y", "force_z", "torque_x", "torque_y", "torque_z")
SHIELDS_RANGE = (0.003, 0.3)  # of the bed stress over which runs with inertia are spread
CREEPING = 1.0  # Reynolds number that stands in scenes of creeping flow, where it has no effect


@dataclass(frozen=True, eq=False)
class LoadCoefficients:
    """Load coefficients (6,) of a full run at a Reynolds number G d^2/nu, and their errors (6,) or None."""

    number: int
    reynolds: float
    values: Floats
    errors: Floats | None


# By the grain's number: the scene of its full run, and that with a wider gap where its error is estimated.
FullRuns = Mapping[int, tuple[Scene, Scene | None]]


def scene_of(
    pocket: Pocket,
    level: float,
    request: Survey,
    reynolds: float,
    error_bars: bool = False,
    wide: bool = False,
) -> Scene:
    """The scene of a full run: the grain, among the neighbours near it as posts on a base plane.

    Neighbours nearer than the gap that represents contact are made smaller; `wide`: twice that gap.

    level: mean height of the bed's surface above the grain's centre, in its diameters: the datum of the shear, and the
    height of the planar far bed.
    """
    radius, gap = 0.5, request.runs.gap * (2.0 if wide else 1.0)
    near, radii = pocket.neighbours / pocket.diameter, pocket.radii / pocket.diameter
    apart = np.linalg.norm(near, axis=1)
    base = min(
        float(near[apart - radii - radius < TOUCHING, 2].mean()), -radius - BELOW, level - BELOW
    )
    radii = np.minimum(radii, apart - radius - gap)
    kept = near[:, 2] + radii > base + BELOW
    near, radii = near[kept], radii[kept]
    aside = np.linalg.norm(near[:, :2], axis=1)
    # The post of a neighbour that is higher and overhangs the grain would cut into it.
    over = (near[:, 2] > 0.0) & (aside < radius + radii + BELOW)
    length = request.runs.domain
    places = near + np.array([0.5 * length, 0.5 * length, -base])
    highest = float((places[:, 2] + radii).max(initial=0.0))  # of neighbours many times as large
    slim = aside - radius - BELOW
    slender = over & (slim > 0.2)  # diameters
    posts = _rows(places[~over], radii[~over]) + _rows(
        places[slender], np.minimum(slim, radii)[slender]
    )
    with_inertia = request.flow.galileo is not None
    return Scene(
        title=f"grain {pocket.number}{' wide gap' if wide else ''}",
        domain=Domain(
            length=length, width=length, height=max(0.5 * length, highest + 0.3 * length)
        ),
        fluid=Fluid(reynolds=reynolds, scale="grain", inertia=with_inertia),
        flow=Shear(rate=1.0, datum=level - base),
        body=Sphere(diameter=1.0, centre=(0.5 * length, 0.5 * length, -base)),
        bed=HeapBed(spheres=tuple(_rows(places[over], radii[over])), posts=tuple(posts)),
        effects=Effects(inertia=with_inertia),
        numerics=Numerics(
            mesh_size=request.runs.mesh_size,
            order=3 if request.runs.order == 3 else 2,
            error_bars=error_bars,
            meshed_bed=request.runs.meshed_bed,
        ),
        output=Output(fields=False),
    )


def _rows(places: Floats, radii: Floats) -> list[tuple[float, float, float, float]]:
    return [(x, y, z, r) for (x, y, z), r in zip(places.tolist(), radii.tolist(), strict=True)]


def reynolds_of(run: int, galileo: float | None) -> float:
    """The Reynolds number of a run: several are spread evenly in the logarithm over the range of thresholds.

    galileo: Galileo number of the run's grain
    """
    if galileo is None:
        return CREEPING
    low, high = (math.log(shields * galileo**2) for shields in SHIELDS_RANGE)
    # Multiples of the golden ratio fill an interval evenly.
    place = (run * 0.6180339887498949 + 0.5) % 1.0
    return float(f"{math.exp(low + place * (high - low)):.6g}")


def coefficients_of(
    runs: FullRuns, rows: Mapping[str, Mapping[str, Any]]
) -> list[LoadCoefficients]:
    """Load coefficients of the finished runs, from rows of a sweep's table by identity.

    Errors are those of the run and the change by twice the gap, if both are known.
    """
    done = {identity: row for identity, row in rows.items() if row["status"] == "done"}
    coefficients = []
    for number, (scene, with_wide_gap) in runs.items():
        row = done.get(identity_of(scene, "run"))
        wide = None if with_wide_gap is None else done.get(identity_of(with_wide_gap, "run"))
        if row is None:
            continue
        reynolds, values, errors = scene.fluid.reynolds, _values(row), None
        if wide is not None and any(f"{name}_high" in row for name in COMPONENTS):
            ends = {name: row.get(f"{name}_high", row.get(name, 0.0)) for name in COMPONENTS}
            errors = reynolds * (_values(ends) - values + np.abs(_values(wide) - values))
        coefficients.append(LoadCoefficients(number, reynolds, reynolds * values, errors))
    return coefficients


def _values(row: Mapping[str, Any]) -> Floats:
    return np.array([float(row.get(name, 0.0)) for name in COMPONENTS])


def relative_error(runs: Sequence[LoadCoefficients]) -> Floats:
    """Errors (6,) of load coefficients over the drag: median over runs with estimates, zero without any."""
    relative = [
        run.errors / abs(run.values[0]) for run in runs if run.errors is not None and run.values[0]
    ]
    return np.median(relative, axis=0) if relative else np.zeros(6)
