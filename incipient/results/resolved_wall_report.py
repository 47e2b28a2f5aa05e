"""What a run says of walls that a model of the mean flow reaches, as data."""

from __future__ import annotations

from dataclasses import dataclass

from .wall_report import MOST_OUTSIDE, WallReport

# Change of the shear stress from cell to cell along a smooth bed, over the stress, beyond which the cell is too long;
# and the share of the stress's whole change that may lie in such cells. Behind the crest of a bump the stress was 40%
# off with a share of 0.36 and 12% with 0.16, compared with cells of a quarter the length
# (tests/end_to_end/test_resolved_along_walls.py).
LARGEST_CHANGE, MOST_COARSE = 0.25, 0.25


@dataclass(frozen=True)
class ResolvedWallReport(WallReport):
    """The walls of a flow that its mesh resolves: y+ is the thickness of the cells at them, in nu/u*.

    mesh_size: the factor of all cells that the run had; distance: the thickest of the cells at walls
    thickest, on_sand: up to which cells at smooth and at rough walls resolve them, in nu/u*; without smooth walls both
    are that of rough ones, without rough ones the second is 0
    excess: largest thickness of a cell over that up to which it resolves its wall
    coarse_along: the largest fraction of the stress's change along a smooth wall that lies in cells in which it
    changes too much, zero along plane walls; None: where all walls are rough cells are not judged
    judged_along: whether it decides, past forms without corners and without a grain. Elsewhere it only withholds that
    walls are resolved: at the grain of demos/scenes/sand_in_turbulence.toml, with a fraction of 0.61, the stress was
    within 2% on average, and 2.3% at its peak, of that on cells of half the size
    """

    mesh_size: float = 1.0
    thickest: float = 2.5
    on_sand: float = 0.0
    excess: float = 1.0
    coarse_along: float | None = None
    judged_along: bool = False

    @property
    def model(self) -> str:
        """Name of the model."""
        return "k-omega-sst"

    @property
    def applicable(self) -> bool:
        """Whether the cells at nearly all walls are thin enough, and those along a smooth bed short enough."""
        return self.outside <= MOST_OUTSIDE and not (self.judged_along and self._coarse_along)

    @property
    def _coarse_along(self) -> bool:
        return self.coarse_along is not None and self.coarse_along > MOST_COARSE

    def _coarse(self, where: str) -> str:
        return (
            f"{100 * (self.coarse_along or 0.0):.2g}% of the change of the shear stress along {where} lie in cells in "
            f"which it changes by more than {100 * LARGEST_CHANGE:g}%"
        )

    @property
    def by_cells(self) -> bool:
        """Whether smaller cells resolve walls."""
        return True

    @property
    def unsuited(self) -> str:
        """What decides how sure a result is where walls are not resolved, in words."""
        return "cells at the walls, which do not resolve them"

    @property
    def suitable(self) -> float:
        """The thickness that the cells at walls might have."""
        return (
            self.thickest * self.viscosity / self.shear_velocity
            if self.shear_velocity
            else float("inf")
        )

    @property
    def remedy(self) -> str:
        """What to do where walls are not resolved."""
        if self.judged_along and self._coarse_along and self.outside <= MOST_OUTSIDE:
            return f"set numerics.mesh_size = {0.5 * self.mesh_size:.2g}"
        return f"set numerics.mesh_size = {0.9 / self.excess * self.mesh_size:.2g}"

    def _of_model(self) -> str:
        return ""

    def _judged(self) -> list[str]:
        told = f"first cells {self.least:.3g} to {self.largest:.3g} nu/u* thick"
        if self.outside:
            told += f", along {100 * self.outside:.3g}% of the walls more than {self.thickest:.3g}"
            if self.on_sand not in (0.0, self.thickest):
                told += f", on rough walls than {self.on_sand:.3g}"
        if self.applicable:
            judged = (
                "" if self.coarse_along is not None else " across; cells along them are not judged"
            )
            if self._coarse_along:
                judged = f" across; {self._coarse('them')}"
            return [f"{told}: walls are resolved{judged}; "]
        bounds = f"at most {100 * MOST_OUTSIDE:g}% may be"
        if self.judged_along and self._coarse_along:
            bounds = f"{self._coarse('the bed')}, at most {100 * MOST_COARSE:g}% may"
        return [f"NOT RESOLVED: {told}, {bounds}; {self.remedy}", ""]
