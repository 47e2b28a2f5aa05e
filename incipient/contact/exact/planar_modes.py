"""Every mode with which a planar case can begin to move under loads that are known only within a box.

The accelerations of a planar case fall into cells (`planar_motion`), in each of which the contact forces allowed are
fixed. The loads that have a solution in a cell are therefore a convex cone, and whether some load of a box is among
them is a linear program. Since every load has a solution, a single mode found over all cells is the mode of all loads.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linprog

from incipient.arrays import Floats
from incipient.contact.exact import fans
from incipient.contact.exact.grasp import Grasp, leave_plane
from incipient.contact.exact.motion import MANY, ZERO
from incipient.contact.exact.motion_modes import Mode, contact_states, mode
from incipient.contact.exact.planar_motion import MotionPlane, plane_problem
from incipient.contact.exact.release import Release, release
from incipient.contact.model import Load
from incipient.geometry.contacts import Contacts


@dataclass(frozen=True, eq=False)
class _Cell:
    """Accelerations y of which some rows are zero, and others at least zero."""

    still: Floats  # (e, 3): rows y = 0
    open: Floats  # (o, 3): rows y >= 0
    edges: Floats  # (c, 3): wrenches of the forces allowed
    turning: Mode  # with rotation
    straight: Mode  # without


def modes_within(
    load: Load, contacts: Contacts, friction: float, ways: Floats, mass: float, inertia: Floats
) -> tuple[Mode, ...] | None:
    """The modes of all motions of loads of a box, none of which is held; None if they cannot be enumerated.

    `ways` (6, m): changes of force and couple of the flow, of which each load has any share from -1 to 1. A mode that
    is missing is excluded for certain; one whose loads the box only touches may be among them. Enumerated are cases in
    the plane of up to 64 contacts. Raises SceneError as `motion.incipient_motion` does. Not collective.
    """
    case = release(load, contacts, friction, mass, inertia)
    units = case.force_unit * np.array([1.0, 1.0, 1.0, *3 * [case.grasp.reach]])
    if case.grasp.plane is None or len(case.grasp) > MANY or case.force_unit == 0.0:
        return None
    changes = ways / units[:, None]
    if leave_plane(case.grasp.plane, changes):
        return None
    problem = plane_problem(case)
    spread = problem.basis @ changes
    found = {one for cell in _cells(problem) for one in _modes_in(cell, problem, spread)}
    found |= set(_modes_of_rays(case, problem, spread))
    return tuple(one for one in Mode if one in found)


def _cells(problem: MotionPlane) -> Iterator[_Cell]:
    """The free accelerations, and those that slide on every contact of one line of action."""
    nothing = np.empty((0, 3))
    yield _Cell(nothing, problem.normal, nothing, Mode.LIFTING_AND_ROTATING, Mode.LIFTING)
    for group in problem.lines_of_action():
        others = np.delete(problem.normal, group, axis=0)
        for signs in problem.ways_to_slide(group):
            edge = np.where(signs > 0.0, -1, -2) % len(problem.fan)
            slides = np.vstack([signs[:, None] * problem.tangent[group], others])
            forces = problem.edges[edge, group]
            yield _Cell(
                problem.normal[group[:1]], slides, forces, Mode.PIVOTING_AND_SLIDING, Mode.SLIDING
            )


def _modes_in(cell: _Cell, problem: MotionPlane, spread: Floats) -> Iterator[Mode]:
    """The modes of loads of the box that have an acceleration in a cell."""
    least = _least_acceleration(cell, problem, spread, 1.0)
    if least is None:
        return
    other = _least_acceleration(cell, problem, spread, -1.0)
    most, none = (
        math.inf if other is None else -other,
        ZERO * math.sqrt(problem.free @ problem.free),
    )
    if least < -none or most > none:
        yield cell.turning
    if least <= none and most >= -none:
        yield cell.straight


def _least_acceleration(
    cell: _Cell, problem: MotionPlane, spread: Floats, sign: float
) -> float | None:
    """The least `sign` times the angular acceleration in a cell, over the box; None: no load has one there."""
    forces, errors = len(cell.edges), spread.shape[1]
    system = np.zeros((3 + len(cell.still), 3 + forces + errors))
    system[:3] = np.hstack([problem.mass, -cell.edges.T, -spread])
    system[3:, :3] = cell.still
    bounds = [(None, None)] * 3 + [(0.0, None)] * forces + [(-1.0, 1.0)] * errors
    answer = linprog(
        sign * np.eye(system.shape[1])[2],
        -np.hstack([cell.open, np.zeros((len(cell.open), forces + errors))]),
        np.zeros(len(cell.open)),
        system,
        np.concatenate([problem.wrench, np.zeros(len(cell.still))]),
        bounds,
        "highs",
        options=fans.SOLVER,
    )
    if answer.success:
        return float(answer.fun)
    return None if answer.status == _INFEASIBLE else -math.inf


def _modes_of_rays(case: Release, problem: MotionPlane, spread: Floats) -> Iterator[Mode]:
    """The modes of loads of the box that have an acceleration where two contacts stay or one sticks."""
    count = spread.shape[1]
    target = np.concatenate([problem.wrench - spread.sum(axis=1), np.full(count, 2.0)])
    for direction in problem.directions():
        edges = problem.edges[problem.allowed_edges(direction)]
        forces = np.column_stack([problem.mass @ direction, -edges.T])
        if fans.combination(fans.beside(forces, -spread), target) is not None:
            yield mode_along(problem, case.grasp, direction)


def mode_along(problem: MotionPlane, held_by: Grasp, direction: Floats) -> Mode:
    """The mode of an acceleration along a direction (3,) of length one in the plane."""
    assert held_by.plane is not None
    turning = direction[2] * held_by.plane[2] * (abs(direction[2]) > ZERO)
    at_contacts = np.zeros((len(held_by), 3))
    at_contacts[:, 0], at_contacts[:, 1] = problem.normal @ direction, problem.tangent @ direction
    states = contact_states(at_contacts, bool(turning.any()), ZERO)
    return mode(states, held_by.frames[:, 0], turning, ZERO)


_INFEASIBLE = 2  # scipy's status of a program without a solution
