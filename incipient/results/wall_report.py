"""Quantities of turbulence along the walls of a run."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from ..arrays import Floats
from .quantity import labelled

# Change of the shear stress along an edge of a cell at a resolved smooth wall, over the stress, beyond which it is
# too long; and the fraction of the stress's whole change that may lie along such edges. Behind the crest of a bump the
# stress was 40% off with a fraction of 0.36 and 12% with 0.16, compared with cells of a quarter the length
# (tests/end_to_end/test_resolved_channels.py).
LARGEST_CHANGE, MOST_COARSE = 0.25, 0.25
# Known errors of models in reverse flow, as `benchmarks/turbulent_meshes.py` measures.
OF_MODEL = {"k-epsilon": "behind steps k-epsilon reattaches 15% too soon"}


@dataclass(frozen=True)
class WallReport:
    """The walls of a turbulent flow.

    distance: of the lower wall from the mesh
    least, largest: y+ along the walls, by each wall's distance from the mesh
    shear_velocity: u*, its mean along the walls; at_outflow: at the downstream end
    friction: C_f = 2 (u*/V)^2 at the downstream end, V being the mean velocity
    plane: whether all walls are planes
    backward: in 2-D intervals along the bed of reverse flow next to it, the longest first
    along: in 2-D by wall: x ascending, y_plus, and friction 2 tau/V^2, negative in reverse flow
    roughness: k_s of the walls
    converged, spread, changes: of a steady flow, see `turbulence.continuation.Continued`
    mesh_size: the run's factor of all cells
    coarse_along: largest fraction of the stress's change along a smooth resolved wall in edges along which
        it changes too much; None: without such a wall, and between planes
    judged_along: whether that decides, past 2-D bedforms without corners and without a grain. At the grain of
        demos/scenes/sand_in_turbulence.toml, with a fraction of 0.61, the stress was within 2% on average, and
        2.3% at its peak, of that on cells of half the size
    """

    derived: ClassVar = ("separated", "warning")
    model: str
    distance: float
    least: float
    largest: float
    shear_velocity: float
    at_outflow: float
    friction: float
    viscosity: float
    plane: bool = True
    roughness: float = 0.0
    backward: tuple[tuple[float, float], ...] = ()
    along: dict[str, dict[str, list[float]]] = field(default_factory=dict)
    converged: bool = True
    spread: float = 0.0
    changes: Sequence[tuple[float, float]] = ()
    mesh_size: float = 1.0
    coarse_along: float | None = None
    judged_along: bool = False

    @property
    def shear_velocities(self) -> Floats:
        """u* (2,) at the downstream end, and its mean along the walls."""
        return np.array([self.at_outflow, self.shear_velocity])

    @property
    def separated(self) -> tuple[float, float] | None:
        """x of separation and reattachment of the longest interval; None without any."""
        return next(iter(self.backward), None)

    @property
    def doubt(self) -> str:
        """Warning of a flow that is not converged, or of too long cells along walls; otherwise empty."""
        return self._unsteady + (self._coarse if self.judged_along else "")

    @property
    def warning(self) -> str:
        return (self._unsteady + self._coarse).removesuffix("; ")

    @property
    def _unsteady(self) -> str:
        if self.converged:
            return ""
        of_flow, of_turbulence = self.changes[-1]
        return (
            f"NOT CONVERGED after {len(self.changes)} iterations: the flow changed by {of_flow:.1e} in the last, the "
            f"turbulence by {of_turbulence:.1e}; loads are means of the last ones, within {100 * self.spread:.2g}%; "
        )

    @property
    def _coarse(self) -> str:
        if (fraction := self.coarse_along or 0.0) <= MOST_COARSE:
            return ""
        text = (
            f"{100 * fraction:.2g}% of the change of the shear stress along the walls lies in cells in which it "
            f"changes by more than {100 * LARGEST_CHANGE:g}%"
        )
        if not self.judged_along:
            return f"{text}; "
        remedy = f"set numerics.mesh_size = {0.5 * self.mesh_size:.2g}"
        return f"NOT RESOLVED: {text}, at most {100 * MOST_COARSE:g}% may; {remedy}; "

    def columns(self) -> dict[str, float]:
        first = self.separated or (math.nan, math.nan)
        ends = zip(("separation", "reattachment"), first, strict=True)
        return {
            "shear_velocity": self.at_outflow,
            "y_plus_min": self.least,
            "y_plus_max": self.largest,
            **(dict(ends) if self.along else {}),
        }

    def lines(self) -> list[str]:
        """Warnings, and a known error of the model in reverse flow."""
        error = OF_MODEL.get(self.model) if self.backward else None
        return [
            *(labelled("warning", self.warning) if self.warning else ()),
            *(labelled("model", error) if error else ()),
        ]
