"""What tests of settling share: starts, and what contradicts an equilibrium, looked at from the outside."""

import numpy as np
from scipy.optimize import nnls

from incipient.geometry import Placement, SettlingOutcome, settle
from incipient.geometry.settle import proximity


def rotation_by(vector):
    """The unit quaternion of a rotation vector (3,)."""
    return Placement((0.0, 0.0, 0.0)).moved((0.0, 0.0, 0.0), vector).quaternion


TILT = rotation_by((0.3, 0.2, 0.1))


def rest(grain, bed, x, turn=0.0):
    """The grain lowered onto the bed above x, turned by an angle or a quaternion."""
    start = (
        Placement((x, 0.0), turn) if grain.gdim == 2 else Placement((*x, 0.0), 0.0, turn or None)
    )
    return proximity(grain, bed).lowered(start)


def above(x, y, tilt=TILT):
    """A start high above the bed in space."""
    return Placement((x, y, 5.0), 0.0, tilt)


def turned(x, angle):
    """A start high above the bed in the plane."""
    return Placement((x, 5.0), angle)


def down(slope, dimension=2):
    """Gravity as on a plane that falls towards positive x."""
    return (
        (np.sin(slope), -np.cos(slope)) if dimension == 2 else (np.sin(slope), 0.0, -np.cos(slope))
    )


def surface_points(grain):
    """Points all over the grain's surface, in the body frame."""
    if grain.gdim == 2:
        return np.vstack([curve.point(np.linspace(0.0, 1.0, 801)) for curve in grain.outline()])
    points = grain.surface(grain.size / 40.0).points
    return points[np.abs(grain.level(points)) < 1e-12 * grain.size]


def flaws(result, grain, bed, gravity=None, friction=1.0):
    """What contradicts an equilibrium, from the outside, by name; `friction` as it was given to settle."""
    if not (result.outcome is SettlingOutcome.RESTS and result.stable):
        return {"outcome": result}
    d, size, placement = grain.gdim, grain.size, result.placement
    points, normals = result.contacts.points[:, :d], result.contacts.normals[:, :d]
    x = placement.to_scene(surface_points(grain))
    gravity = np.array(([0.0] * (d - 1) + [-1.0]) if gravity is None else gravity, dtype=float)
    measured = {
        "off the grain": (np.abs(grain.level(placement.to_body(points))).max() / size, 1e-9),
        "off the bed": (np.abs(bed.distance(points)).max() / size, 1e-9),
        # Beds and outlines are evaluated to round-off; a corner of the bed may be met between the points.
        "in the bed": ((bed.height(x[:, 0] if d == 2 else x[:, :2]) - x[:, -1]).max() / size, 1e-9),
        "unbalanced": (
            unbalanced(points - placement.centre, -normals, gravity, friction, size),
            1e-8,
        ),
    }
    return {name: value for name, (value, limit) in measured.items() if not value <= limit}


def unbalanced(arms, inward, gravity, friction, size):
    """What is left of the weight and its couple by the best forces within the friction cones."""
    arms, inward = (np.pad(a, ((0, 0), (0, 3 - a.shape[1]))) for a in (arms, inward))
    rows = []
    for arm, normal in zip(arms, inward, strict=True):
        rim = [np.eye(3)[2]] if len(gravity) == 2 else np.linalg.svd(normal[None])[2][1:]
        first = np.cross(normal, rim[0])
        around = [first, -first]
        if len(gravity) == 3:
            angles = np.linspace(0.0, 2.0 * np.pi, 64, endpoint=False)
            around = [np.cos(a) * rim[0] + np.sin(a) * rim[1] for a in angles]
        forces = [normal, *(normal + min(friction, 1e3) * side for side in around)]
        rows += [np.concatenate([force, np.cross(arm, force) / size]) for force in forces]
    load = np.zeros(6)
    load[: len(gravity)] = gravity
    return nnls(np.array(rows).T, -load)[1]


def after_a_period(result, grain, bed, start, period, **how):
    """By how much the rest moves, and turns, if the grain starts one period of the bed further on."""
    moved = Placement(np.add(start.centre, period), start.angle, start.quaternion)
    other = settle(grain, bed, moved, **how).placement
    turn = np.abs(other.rotation - result.placement.rotation).max()
    return np.subtract(other.centre, result.placement.centre), turn
