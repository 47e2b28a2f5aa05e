"""Resolutions of a cost study: orders, cell sizes and time steps around a scene's."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from ..accuracy.coarse_runs import changed
from ..errors import refuse_broken
from ..planning.discretisation import order_of
from ..scene import Scene
from ..scene.sections import MESH_SIZES

RATIO = math.sqrt(2.0)  # of cell sizes from one rung to the next; steps are halved
BY_REFINEMENT = ("accuracy", "accuracy_includes", "budget_seconds", "budget_mib", "geometry_order")
EXAMPLES = {"orders": "2 3", "sizes": "2 1.4 1", "steps": "4 2 1"}


@dataclass(frozen=True, order=True)
class Rung:
    """A resolution: velocity order, factor on cell sizes, time step (None: steady)."""

    order: int
    mesh_size: float
    step: float | None = None

    @property
    def name(self) -> str:
        step = "" if self.step is None else f", step {self.step:.4g}"
        return f"P{self.order}-P{self.order - 1}, mesh_size {self.mesh_size:.4g}{step}"

    def finer(self, times: int) -> Rung:
        step = self.step and self.step / 2.0**times
        return Rung(self.order, self.mesh_size / RATIO**times, step)

    def is_close(self, other: Rung) -> bool:
        mine, others = ((rung.order, rung.mesh_size, rung.step or 0.0) for rung in (self, other))
        return np.allclose(mine, others, rtol=1e-9, atol=0.0)

    def of(self, scene: Scene) -> Scene:
        """The scene at this resolution, without error bars and output. Raises SceneError."""
        fields = type(scene.numerics).model_fields
        numerics = {name: fields[name].default for name in BY_REFINEMENT} | {
            "order": self.order,
            "mesh_size": self.mesh_size,
            "error_bars": False,
        }
        output = {"fields": False, "pictures": False, "every": 0, "checkpoint": 0}
        time = {} if self.step is None else {"time": {"step": self.step, "tolerance": None}}
        return changed(scene, numerics=numerics, output=output, **time)


def own_rung(scene: Scene) -> Rung:
    """Resolution of the scene, defaults included."""
    step = None if scene.time is None else scene.time.step
    return Rung(order_of(scene), scene.numerics.mesh_size, step)


def ladder(
    scene: Scene,
    quick: bool = False,
    orders: Sequence[int] | None = None,
    sizes: Sequence[float] | None = None,
    steps: Sequence[float] | None = None,
) -> tuple[Rung, ...]:
    """Rungs of a scene, its own included; the last and finest is the reference.

    Args:
        quick: the scene's own order with coarser cells and steps only.
        sizes, steps: multiples of the scene's; default: those affordable for such a scene.

    Raises SceneError for a fluid at rest, invalid values, or steps of a steady scene.
    """
    choices = {"orders": orders, "sizes": sizes, "steps": steps}
    refuse_broken(
        (
            scene.is_still,
            "flow.kind: the fluid is at rest, and no run has a load to compare; use another",
        ),
        *(
            (
                values is not None and (not values or min(values) <= 0.0),
                f"--{name}: give positive numbers, such as {EXAMPLES[name]}",
            )
            for name, values in choices.items()
        ),
        (not {*(orders or ())} <= {2, 3, 4}, "--orders: the velocity has order 2, 3 or 4"),
        (steps and scene.time is None, "--steps: the scene is steady; leave it out"),
    )
    own = own_rung(scene)
    # The cheapest order in 3-D is known (docs/contribute/defaults.md).
    by_default = (2, 3) if scene.is_averaged or scene.time is not None else (2, 3, 4)
    orders = orders or ((own.order,) if quick or scene.gdim == 3 else by_default)
    many = 2 if quick else 3 if scene.gdim == 3 or scene.time else 4 if scene.is_averaged else 5
    sizes = sizes or (2.0, RATIO, 1.0, 1.0 / RATIO, 0.5)[:many]
    cells = np.clip(np.multiply(sizes, own.mesh_size), *MESH_SIZES).tolist()
    times: list[float | None] = [None]
    if scene.time is not None:
        multiples, longest = steps or (4.0, 2.0, 1.0)[: 3 - quick], scene.time.end / 2.0
        times = [min(multiple * scene.time.step, longest) for multiple in multiples]
    rungs = {own, *(Rung(*values) for values in product(orders, cells, times))}
    # The finest rung, then the reference.
    finest = Rung(
        max(rung.order for rung in rungs),
        min(rung.mesh_size for rung in rungs),
        None if scene.time is None else min(rung.step or 0.0 for rung in rungs),
    )
    coarse_first = sorted(
        {*rungs, finest}, key=lambda rung: (rung.order, -rung.mesh_size, -(rung.step or 0.0))
    )
    return (*coarse_first, finest.finer(1))
