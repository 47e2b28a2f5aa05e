"""Processor time and memory of a run from what it has to do: a law fitted to runs on this machine.

Time beyond the start is a sum of kinds of work with prices that are not negative: meshing, assembling and
factorising matrices, iterations, time steps. Which work a scene calls for is taken from runs of that scene, or of
those that are most like it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..arrays import Floats
from ..planning import drawing
from .counts import NOTHING, Counts

AGAIN = 0.3  # of what a process pays once, meshing and setting up forms that are loaded already: measured
STEADY, UNSTEADY, MOVING = "steady", "unsteady", "moving"


@dataclass(frozen=True)
class Work:
    """What a run has to do."""

    kind: str
    order: int
    cells: int
    unknowns: int
    counts: Counts = NOTHING

    def parts(self) -> list[float]:
        """Amounts of each kind of work; the first is what the first run of a process pays whatever it computes."""
        n, local, done = float(self.unknowns), _unknowns_of_a_cell(self.order), self.counts
        moves = self.kind == MOVING
        return [
            1.0,
            self.cells * (1.0 + done.remeshings),
            done.factorisations * self.cells * local**2,
            done.factorisations * n**1.5,
            (done.newton + done.steps) * self.cells * local,
            (done.krylov + done.newton) * n * math.log2(n),
            done.steps * self.cells * local if moves else 0.0,
        ]


@dataclass(frozen=True)
class Known:
    """A run that was measured: of which scene (a digest), how finely, its work, processor time [s], memory [MiB].

    reynolds: of the whole flow; times in units of the flow's: `step`
    """

    scene: str
    work: Work
    mesh_size: float
    step: float
    reynolds: float
    convection: str
    start: float
    cpu: float
    peak_mib: float


@dataclass(frozen=True)
class Prices:
    """Seconds of processor time for a unit of each kind of work, and for starting."""

    start: float
    of_parts: Floats

    def cpu(self, work: Work) -> float:
        """Processor time [s] of a run."""
        return self.start + self.beyond_start(work)

    def beyond_start(self, work: Work) -> float:
        """The same without starting the program."""
        return float(self.of_parts @ work.parts())

    def again(self, work: Work) -> float:
        """The same for a further run in a process that has made one."""
        return self.beyond_start(work) - (1.0 - AGAIN) * float(self.of_parts[0])


def prices(known: Sequence[Known]) -> Prices:
    """The prices that fit runs best, errors taken relative to their times."""
    from scipy.optimize import nnls

    start = min(run.start for run in known)
    cpu = np.array([run.cpu for run in known])
    parts = np.array([run.work.parts() for run in known]) / cpu[:, None]
    size = np.maximum(np.abs(parts).max(axis=0), 1e-300)
    found, _ = nnls(parts / size, (cpu - start) / cpu)
    return Prices(start, found / size)


def correction(prices: Prices, known: Sequence[Known]) -> float:
    """The factor that makes the law right for runs of one scene on (geometric) average; 1 without any."""
    ratios = [max(run.cpu - prices.start, 0.01) / max(prices.beyond_start(run.work), 0.01) for run in known]
    return math.exp(float(np.mean(np.log(ratios)))) if ratios else 1.0


def memory_correction(known: Sequence[Known]) -> float:
    """The factor between measured memory and that of `drawing.memory`."""
    ratios = [run.peak_mib / drawing.memory(run.work.unknowns) for run in known]
    return math.exp(float(np.mean(np.log(ratios)))) if ratios else 1.0


def work_like(known: Known, order: int, cells: int, unknowns: int, steps: float) -> Work:
    """The work of a run on another mesh with other steps, with the iterations of a known one."""
    counts = known.work.counts
    longer = steps / counts.steps if counts.steps else 1.0
    factorisations = max(round(longer * counts.factorisations), 1)
    newton, krylov = round(longer * counts.newton), round(longer * counts.krylov)
    made = replace(counts, steps=round(steps), newton=newton, factorisations=factorisations, krylov=krylov)
    return replace(known.work, order=order, cells=cells, unknowns=unknowns, counts=made)


def most_alike(known: Sequence[Known], like: Known) -> Known:
    """The run whose iterations a run is likely to share: of its scene if there is one, of its kind else."""

    def distance(run: Known) -> tuple[float, ...]:
        """What counts most first: scene, kind, convection, then Reynolds number, order, cells and steps."""
        far = abs(math.log(run.reynolds / like.reynolds))
        finer = abs(math.log(run.mesh_size / like.mesh_size))
        if run.step and like.step:
            finer += abs(math.log(run.step / like.step))
        others = (run.scene != like.scene, run.work.kind != like.work.kind, run.convection != like.convection)
        return (*map(float, others), far, abs(run.work.order - like.work.order), finer)

    return min(known, key=distance)


def _unknowns_of_a_cell(order: int) -> int:
    velocity, pressure = (order + 1) * (order + 2), order * (order + 1) // 2
    return velocity + pressure
