"""Runs of a study that are made up: nothing is computed, and their laws are known."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from incipient.cost import study as cost
from incipient.cost.ladder import ladder, spread
from incipient.cost.measurement import Counts, MeasuredRun, Variant
from incipient.scene import Scene, loads
from incipient.scene.example import commented, grain_on_bed

COLUMNS = ("force_x", "force_y", "couple", "safety_factor")
TIMED = 'time={end = 1.0, step = 0.01, start = "stokes"}'


def scene(*overrides: str) -> Scene:
    return loads(commented(grain_on_bed()), overrides=overrides)


class Runner:
    """Runs whose force is off by 0.02 h^p and that take 1 + h^-2 seconds; counts them; some fail."""

    def __init__(self, *failing: Variant):
        self.made: list[Variant] = []
        self.failing = {variant.key for variant in failing}

    def __call__(self, scene: Scene, variant: Variant) -> MeasuredRun:
        self.made.append(variant)
        if variant.key in self.failing:
            return MeasuredRun(variant, 1.0, 0.5, failed='no steady flow, "of course", found')
        off = 1.0 + 0.02 * (variant.mesh_size / 2.0) ** (variant.order + 2)
        found = {
            "force_x": 3.0 * off,
            "force_y": 4.0 * off,
            "couple": 0.5 * off,
            "safety_factor": 1.5 * off,
        }
        unknowns = round(4000 * variant.mesh_size**-2)
        cpu = 1.0 + 0.2 * variant.mesh_size**-2 * variant.order
        counts = Counts(newton=5, factorisations=2)
        return MeasuredRun(
            variant, 2.0 * cpu, cpu, 0.5, 200.0, unknowns // 5, unknowns, counts, found
        )


def quiet(text: str) -> None:
    """Say nothing."""


def studied(
    directory: Path, runner: Runner, quick: bool = False, ways: tuple[str, ...] | None = ()
) -> cost.Study:
    made = scene()
    wanted = replace(spread(made, quick), solvers=ways)
    return cost.run_ladder(made, ladder(made, wanted), directory, runner, quiet)
