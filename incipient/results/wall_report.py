"""What a run says of the turbulence at its walls, as data."""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any, Protocol

import numpy as np

from ..arrays import Floats
from ..planning.wall_law import HIGHEST, LARGEST_SHARE, LOWEST, WallLaw
from .errorbars import MOST_SPANS
from .trajectory import place_words

REATTACHES = (
    "behind steps the model reattaches 15% too soon"  # as `benchmarks/turbulent_step.py` measures
)
MOST_OUTSIDE = 0.1  # of the walls' length, in 3-D of their area, where some are no planes


class Iteration(Protocol):
    """How the iteration to a steady flow ended."""

    @property
    def converged(self) -> bool:
        """Whether flow and turbulence changed by less than the tolerance in the last iteration."""

    @property
    def changes(self) -> Sequence[tuple[float, float]]:
        """Relative changes of the flow, and of the logarithms of the turbulence, in each iteration."""

    @property
    def spread(self) -> float:
        """Relative deviation of the loads of the last iterations from their mean; 0: converged."""


@dataclass(frozen=True)
class WallReport:
    """The walls of a turbulent flow."""

    distance: float  # of the mesh's boundary from the walls
    # least, largest: of y+, that distance in nu/u*, along the walls
    least: float
    largest: float
    shear_velocity: float  # u*, its mean along the walls
    at_outflow: float  # that at the downstream end
    friction: float  # C_f = 2 (u*/V)^2 at the downstream end, V being the mean velocity
    viscosity: float
    c_mu: float
    # Share of the walls' length, in 3-D of their area, where the law does not hold at that distance
    outside: float = 0.0
    plane: bool = (
        True  # whether all walls are planes; else the flow may separate, where y+ may be small
    )
    # In 2-D intervals along the bed of reverse flow next to it
    backward: tuple[tuple[float, float], ...] = ()
    # In 2-D by names of walls: x, y_plus, and friction 2 tau/V^2, below zero in reverse flow, at
    # nodes of ascending x
    along: dict[str, dict[str, list[float]]] = field(default_factory=dict)
    roughness: float = 0.0  # equivalent sand roughness of the walls
    reach: float = math.inf  # depth over which a wall is felt
    iteration: Iteration | None = None  # of a steady flow

    @property
    def model(self) -> str:
        """Name of the model."""
        return "k-epsilon"

    @property
    def applicable(self) -> bool:
        """Whether the law of the wall holds: at all walls, or at nearly all where the flow may separate."""
        if self.plane:
            ends = np.array([self.least, self.largest]) * self.viscosity / self.distance
            return bool(self._law.holds(ends, self.viscosity, self.distance, self.reach).all())
        return self.outside <= MOST_OUTSIDE

    @property
    def unsuited(self) -> str:
        """What decides how sure a result is where the walls are not as the model asks, in words."""
        return "law of the wall, which is not applicable here"

    @property
    def _law(self) -> WallLaw:
        return WallLaw(self.roughness)

    @property
    def shear_velocities(self) -> Floats:
        """(2,) u* at the downstream end, and its mean along the walls."""
        return np.array([self.at_outflow, self.shear_velocity])

    @property
    def separated(self) -> Floats:
        """(2,) x at which the flow along the bed separates and reattaches, farthest apart; (0,) where it does not."""
        return np.array(max(self.backward, key=lambda span: span[1] - span[0], default=()))

    @property
    def leading(self) -> int:
        """Index of the representative of `shear_velocities`: over a bed that is not planar, the mean along the walls.

        Where the flow leaves over a slope the stress at the last node does not converge with the mesh.
        """
        return 0 if self.plane else 1

    @property
    def suitable(self) -> float:
        """The distance that the mesh would have to stand off from the walls; infinite where nothing flows."""
        return self._law.suitable(self.shear_velocity, self.viscosity)

    @property
    def remedy(self) -> str:
        """What to do where the law does not hold: a distance that the plan accepts, or a faster flow."""
        if self.suitable > LARGEST_SHARE * self.reach:
            return "use a larger fluid.reynolds"
        found = f"set turbulence.wall_distance = {self.suitable:.3g}"
        return found + (", or use a larger fluid.reynolds" if self.suitable > self.distance else "")

    @property
    def by_cells(self) -> bool:
        """Whether smaller cells make walls as the model asks."""
        return False

    @property
    def doubt(self) -> str:
        """Warning where walls violate the model's assumptions or the flow has not converged; otherwise empty."""
        if self.applicable and self.converged:
            return ""
        return self._unconverged() + self._judged()[0].removesuffix("; ")

    @property
    def converged(self) -> bool:
        """Whether the flow is one in time, or a steady one that has converged."""
        return self.iteration is None or self.iteration.converged

    @property
    def spread(self) -> float:
        """Relative deviation of the loads of the last iterations from their mean; 0: converged."""
        return 0.0 if self.iteration is None else self.iteration.spread

    def _unconverged(self) -> str:
        """What is said of a flow that has not converged; else empty."""
        if self.iteration is None or self.converged:
            return ""
        changes = self.iteration.changes
        of_flow, of_turbulence = changes[-1]
        return (
            f"NOT CONVERGED after {len(changes)} iterations: the flow changed by {of_flow:.1e} in the last, the "
            f"turbulence by {of_turbulence:.1e}; loads are means of the last ones, within {100 * self.spread:.2g}%; "
        )

    def columns(self) -> dict[str, float]:
        """Columns of the history."""
        found = {
            "shear_velocity": self.at_outflow,
            "y_plus_min": self.least,
            "y_plus_max": self.largest,
        }
        return found | self._separation()

    def _separation(self) -> dict[str, float]:
        """Columns of where the flow separates and reattaches, in 2-D: x of `separated`, NaN without."""
        if not self.along:
            return {}
        separation, reattachment = self.separated if self.backward else (math.nan, math.nan)
        return {"separation": float(separation), "reattachment": float(reattachment)}

    def to_dict(self) -> dict[str, Any]:
        """Plain data for result.json."""
        found = {
            "applicable": self.applicable,
            "suitable_distance": self.suitable,
            "model": self.model,
        }
        found["separated"] = self.separated if self.backward else None
        stored = asdict(replace(self, iteration=None)) | found
        del stored["iteration"]
        changes = () if self.iteration is None else self.iteration.changes
        stored |= {"converged": self.converged, "spread": self.spread, "changes": changes}
        return stored | {"remedy": "" if self.applicable else self.remedy}

    def lines(self, errors: Floats | None = None, ends: Floats | None = None) -> list[str]:
        """The lines for a reader, with errors (2,) of both shear velocities and of `separated` where they are known."""
        (first, *others), friction = self._judged(), self._friction(errors)
        first = self._unconverged() + first
        if self.backward:
            friction += (
                f"; reverse flow next to the bed from x = {self._spans(ends)}{self._of_model()}"
            )
        lines = [first, friction] if others else [first + friction]
        return [f"{name:<20}{line}" for name, line in zip(("turbulence", ""), lines, strict=False)]

    def _of_model(self) -> str:
        """Known errors of the model in reverse flow, in words."""
        return f" ({REATTACHES})"

    def _judged(self) -> list[str]:
        """What is said of the walls, before what they exert; with a second line where they are not as they must be."""
        told = f"y+ of the walls {self.least:.3g} to {self.largest:.3g}"
        if self.roughness:
            away, sand = self.distance / self.roughness, self.roughness / self.distance
            told += f", {away:.3g} times the roughness off"
            told += f", u* k/nu {sand * self.least:.3g} to {sand * self.largest:.3g}"
        if not self.plane and self.outside:
            told += f", along {100 * self.outside:.3g}% of them not from {self._bounds()}"
        if self.applicable:
            return [f"{told}: the law of the wall holds; "]
        bounds = f"the law of the wall holds from {self._bounds()}"
        if not self.plane:
            bounds = f"at most {100 * MOST_OUTSIDE:g}% may be"
        return [f"NOT APPLICABLE: {told}, {bounds}; {self.remedy}", ""]

    def _bounds(self) -> str:
        """The bounds within which the law holds, in words."""
        if not self.roughness:
            return f"{LOWEST:g} to {HIGHEST:g}"
        lowest, highest = self._law.bounds(self.shear_velocity, self.viscosity, self.reach)
        return f"a distance of {lowest:.3g} to {highest:.3g}"

    def _spans(self, ends: Floats | None) -> str:
        """The intervals of x of reverse flow next to the bed."""
        told, others = longest(self.backward)
        within = "" if ends is None else " (within {:.1e} and {:.1e})".format(*ends)
        main = tuple(self.separated)
        spans = ", ".join(
            f"{place_words(one[0])} to {place_words(one[1])}{within * (tuple(one) == main)}"
            for one in told
        )
        return spans + (f", and in {others} shorter places" if others else "")

    def _friction(self, errors: Floats | None) -> str:
        """What the walls exert, in words: at the outflow, over a bed that is not level in the mean."""
        within = ["", ""]
        if errors is not None and self.at_outflow:
            error = errors[0] / self.at_outflow
            within = [
                f", within {errors[0]:.1e},",
                f", within {(2.0 + error) * error * self.friction:.1e},",
            ]
        told = f"u* {self.at_outflow:.5g}{within[0]} and C_f {self.friction:.5g}{within[1]} at the outflow"
        if self.plane or errors is None:
            return told
        return f"{told}; u* {self.shear_velocity:.5g}, within {errors[1]:.1e}, on average along the walls"


def longest(spans: Sequence[Sequence[float]]) -> tuple[list[Sequence[float]], int]:
    """The longest few of spans, as they are sorted, and how many others there are: narrow wedges have many."""
    chosen = sorted(range(len(spans)), key=lambda i: spans[i][0] - spans[i][1])[:MOST_SPANS]
    return [spans[i] for i in sorted(chosen)], len(spans) - len(chosen)
