"""Hard cases that tests and `make stress` share: each function runs one of them and says what it found."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from domains import rectangle, unit_box
from floating import Floating, box_around, floating, lid
from mpi4py import MPI

from incipient.arrays import Floats
from incipient.body.state import BodyState
from incipient.coupled.coupling import Coupling
from incipient.coupled.rigid import End, Response, RigidPart
from incipient.coupled.tractions import TractionProbe
from incipient.errors import ConvergenceError, IncipientError
from incipient.fluid import FlowModel, Fluid, Prescribed, no_slip, solve_steady
from incipient.fluid.newton import NewtonReport
from incipient.fluid.transient import Transient
from incipient.geometry.placement import Placement
from incipient.geometry.plane.grains import Disc
from incipient.mesh.domain import build
from incipient.mesh.sampling import extremum
from incipient.meshes import Near
from incipient.meshes.model import meshed

WALLS = ("left", "right", "bottom")
DISC = Disc(0.3)


@dataclass(frozen=True)
class Ride:
    """A body's ride: largest velocity of its centre, most corrections in a step, how it ended."""

    speed: float
    corrections: int
    ended: str
    readings: Floats

    @property
    def completed(self) -> bool:
        return self.ended == "completed"


def steady_lid(x: Floats, t: float) -> Floats:
    return np.vstack([np.ones_like(x[0]), 0 * x[0]])


# -- bodies -------------------------------------------------------------------------------------


class Once(Coupling):
    """A coupling that gives up at once where a step does not converge, instead of trying shorter ones."""

    def attempt(
        self, length: float, order: int, tolerance: float, before: NewtonReport | None = None
    ) -> NewtonReport:
        report = super().attempt(length, order, tolerance, before)
        if not report.converged:
            raise ConvergenceError(f"the step of {length:.3g} does not converge")
        return report


class Naive(RigidPart):
    """A body whose iteration passes forces and velocities back and forth, without the traction's derivative."""

    def _responded(self, before: End, end: End) -> Response:
        size = self.body.size
        changes = np.zeros((size, len(self.fluid.state.x.array)))
        return Response(changes, np.zeros((size, size)), end.length, 0)

    def _stiffness(self, end: BodyState, load: Floats, length: float) -> Floats:
        return np.zeros((self.body.size, self.body.size))


@contextmanager
def in_cavity(
    mass_ratio: float,
    inertia_ratio: float | None = None,
    reynolds: float = 10.0,
    gap: float | None = None,
    cell: float = 0.08,
    far: float = 0.15,
    **more: Any,
) -> Iterator[Floating]:
    """A disc in the unit cavity, of ratios of mass and inertia to the fluid's; a gap is to the bottom, in diameters."""
    y = 0.6 if gap is None else DISC.size * (0.5 + gap)
    placement = Placement((0.55, y), 0.0)
    in_gap = () if gap is None else (near_gap(placement, gap),)
    domain = box_around(DISC, placement, cell, far, more=in_gap)
    moment = (mass_ratio if inertia_ratio is None else inertia_ratio) * DISC.inertia[2, 2]
    conditions = [Prescribed("top", lid), *(no_slip(name) for name in WALLS)]
    mass = mass_ratio * DISC.volume
    with floating(domain, DISC, placement, conditions, reynolds, mass, moment, **more) as result:
        yield result


def near_gap(placement: Placement, gap: float) -> Near:
    x, y = placement.centre
    return Near(0.5 * gap * DISC.size, 0.18, points=((x, y - 0.5 * DISC.size), (x, 0.0)))


def ride(result: Floating, step: float, count: int, once: bool = False) -> Ride:
    """Let the body go for so many steps; a failure is told, not raised. `once`: shorter steps are not tried."""
    if once:
        result.coupling.__class__ = Once
    readings, most, ended = [result.reading()], 0, "completed"
    try:
        for taken in result.transient.march(count * step, step):
            readings.append(result.reading())
            most = max(most, taken.report.corrected)
    except IncipientError as error:
        ended = str(error)
    found_readings = np.array(readings)
    speed = float(np.linalg.norm(found_readings[:, :2], axis=1).max())
    return Ride(speed, most, ended, found_readings)


# What a step is unless a panel of the map has it otherwise (benchmarks/stress_map.py).
USUAL = {"step": 0.05, "reynolds": 10.0}
# The naive iteration gets many more than the exact one, whose limit is that of every run.
ITERATIONS = {True: 12, False: 40}


def corrections(panel: str, value: float, ratio: float, exact: bool) -> int | None:
    """Most corrections in the first three steps of a disc in the cavity whose lid is set off at once.

    None where a step does not converge; steps are not shortened.
    """
    asked: dict[str, Any] = USUAL | {panel: value}
    with in_cavity(
        ratio, reynolds=asked["reynolds"], gap=asked.get("gap"), cell=0.1, far=0.2
    ) as result:
        if not exact:
            result.part.__class__ = Naive
        result.coupling.max_iterations = ITERATIONS[exact]
        with np.errstate(all="ignore"):
            told = ride(result, asked["step"], 3, once=True)
    return told.corrections if told.completed else None


# -- flows --------------------------------------------------------------------------------------


def driven_cavity(reynolds: float, n: int, model: FlowModel) -> Fluid:
    """The unit cavity with n cells a side, all alike."""
    conditions = [Prescribed("top", steady_lid), *(no_slip(name) for name in WALLS)]
    return Fluid(unit_box(2, n), model, conditions, reynolds)


def steady_cavity(reynolds: float, n: int, stabilisation: bool) -> tuple[float, float, float]:
    """Extreme velocities on the centrelines, approached by continuation."""
    with driven_cavity(reynolds, n, FlowModel(stabilisation=stabilisation)) as fluid:
        solve_steady(fluid, 1e-8, first_share=min(1.0, 200.0 / reynolds))
        return extrema(fluid)


def extrema(fluid: Fluid) -> tuple[float, float, float]:
    """Minimum of v1 on x = 1/2, maximum and minimum of v2 on y = 1/2."""
    upright = lambda s: np.column_stack([np.full_like(s, 0.5), s])  # noqa: E731
    level = lambda s: np.column_stack([s, np.full_like(s, 0.5)])  # noqa: E731
    wanted = ((0, upright, -1), (1, level, 1), (1, level, -1))
    low, high, lowest = (
        extremum(fluid.velocity, c, line, (0.0, 1.0), sign=s).value for c, line, s in wanted
    )
    return low, high, lowest


def fastest(reynolds: float, n: int, step: float, count: int, model: FlowModel) -> float:
    """A lid set off at once: the largest speed in all steps relative to the lid's."""
    with driven_cavity(reynolds, n, model) as fluid:
        steps = Transient(fluid).march(count * step, step)
        return max(float(np.abs(fluid.velocity.x.array).max()) for _ in steps)


# -- a cylinder close to a wall -----------------------------------------------------------------

MOTIONS: dict[str, Callable[[Floats, Sequence[float]], Floats]] = {
    "towards": lambda x, c: np.vstack([0 * x[0], -np.ones_like(x[0])]),
    "along": lambda x, c: np.vstack([np.ones_like(x[0]), 0 * x[0]]),
    "turning": lambda x, c: np.vstack([-(x[1] - c[1]), x[0] - c[0]]),
}


def wall_force(motion: str, gap: float, wide: float = 6.0) -> float:
    """Force (or torque) that resists a cylinder's motion of unit speed (spin) beside a wall in Stokes flow, over nu."""
    placement = Placement((0.0, DISC.size * (0.5 + gap)), 0.0)
    low, high = (-0.5 * wide, 0.0), (0.5 * wide, 0.5 * wide)
    in_gap = (near_gap(placement, gap),)
    domain = box_around(DISC, placement, 0.1 * DISC.size, 0.6, low, high, more=in_gap)
    moved = Prescribed("body", lambda x, t: MOTIONS[motion](x, placement.centre))
    walls = [no_slip(name) for name in ("left", "right", "bottom", "top")]
    with Fluid(domain, FlowModel(inertia=False), [moved, *walls], 1.0) as fluid:
        fluid.solve(1e-10)
        result = TractionProbe(fluid, "body", placement.centre).resultant()
    of_motion = {
        "towards": result.force[1],
        "along": -result.force[0],
        "turning": -result.torque[2],
    }
    return float(of_motion[motion])


def exact_wall_force(motion: str, gap: float) -> float:
    """Jeffrey & Onishi (1981), Q. J. Mech. Appl. Math. 34, 129: a cylinder beside an endless wall.

    With d the distance of its axis, a its radius: 4 pi/(alpha - tanh alpha) towards the wall, 4 pi/alpha along
    it, cosh alpha = d/a; turning 4 pi a^2 coth alpha.
    """
    a = 0.5 * DISC.size
    alpha = float(np.arccosh(1.0 + 2.0 * gap))
    if motion == "towards":
        return 4 * np.pi / (alpha - np.tanh(alpha))
    return 4 * np.pi / alpha if motion == "along" else 4 * np.pi * a**2 / np.tanh(alpha)


# -- domains ------------------------------------------------------------------------------------


def poiseuille_error(length: float, height: float, columns: int, rows: int) -> float:
    """The largest error of a parabolic flow through a channel, relative: it is in the elements' space."""
    grid = rectangle((0.0, 0.0), length, height, columns, rows)
    domain = build(MPI.COMM_WORLD, partial(meshed, grid))

    def parabola(x: Floats, t: float) -> Floats:
        s = x[1] / height
        return np.vstack([4 * s * (1 - s), 0 * s])

    sides = [Prescribed(name, parabola) for name in ("left", "right", "bottom", "top")]
    with Fluid(domain, FlowModel(), sides, 100.0 / height) as fluid:
        solve_steady(fluid, 1e-10)
        v = fluid.velocity.x.array.reshape(-1, 2)
        return float(np.abs(v - parabola(fluid.constraints.points.T, 0.0).T).max())
