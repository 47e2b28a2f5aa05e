"""Where a placed grain touches its bed: the contact surface Gamma_c as points, patches by extreme points."""

import numpy as np

from incipient.arrays import Floats, planar_cross, quarter_turned, spatial
from incipient.errors import SceneError
from incipient.geometry.contacts import Contacts
from incipient.geometry.placement import Placement
from incipient.geometry.plane.bed import Bed
from incipient.geometry.plane.curves import Line
from incipient.geometry.plane.distance import Approach, approaches, placed_outline
from incipient.geometry.plane.grain import Grain
from incipient.geometry.proximity import proximity
from incipient.geometry.space.closest import SpatialProximity
from incipient.geometry.space.footprint import footprint
from incipient.geometry.space.solid import Solid
from incipient.geometry.space.terrain import Terrain

SAME_DIRECTION = 1e-6  # normals closer than this belong to the same contact

Contact = tuple[Floats, Floats, float]  # point (2,), normal (2,) out of the grain, area
Patch = tuple[Floats, Floats]  # both ends (2, 2), normal (2,) out of the grain


def touching(
    grain: Grain | Solid, placement: Placement, bed: Bed | Terrain, tolerance: float
) -> Contacts:
    """All contacts of a grain whose distance from the bed is at most `tolerance` (a length, scene units).

    Point contacts are the local minima of the distance along the outline (in space: over the surface). A
    straight side that lies on a straight piece of bed is a patch: its two ends, each with half of its length
    as area; in space a flat face is one on a flat piece of bed, given by the corners of its convex hull with
    areas that add up to that of the patch and have its centroid. `areas` is None if there is no patch. The
    normal, out of the grain, is the grain's own where its surface is smooth, minus the bed's at a corner of
    the grain; where a corner of the grain stands in a valley's corner there are two contacts, one for each
    side of the valley; where it stands on a corner of the bed, minus the bisector of the bed's sides.

    Raises SceneError if nothing touches, or if only one of grain and bed is planar.
    """
    if not tolerance > 0.0:
        raise SceneError(
            f"contact tolerance {tolerance} is not a positive length; give a positive number"
        )
    if isinstance(grain, Grain) and isinstance(bed, Bed):
        return _planar(grain, placement, bed, tolerance)
    near = proximity(grain, bed)
    assert isinstance(near, SpatialProximity)
    return footprint(near, placement, tolerance)


def exposed(
    grain: Grain | Solid, placement: Placement, bed: Bed | Terrain, points: Floats, tolerance: float
) -> np.ndarray:
    """Which points (n, gdim) of a grain's surface belong to Gamma_e, (n,) of bool: the rest touches the bed.

    `points` are in the body frame; what is within `tolerance` (a length) of the bed touches it.
    """
    proximity(grain, bed)  # refuses what is planar together with what is not
    return np.asarray(bed.distance(placement.to_scene(points)) > tolerance)


def require_on_grain(
    contacts: Contacts, grain: Grain | Solid, placement: Placement, tolerance: float
) -> None:
    """Refuse contacts that are farther than `tolerance` (a length) from the grain, or whose normal points into it.

    For contacts that come from elsewhere than `touching`. Raises SceneError, which names the first such contact.
    """
    d = grain.gdim
    x, normals = (
        placement.to_body(contacts.points[:, :d]),
        contacts.normals[:, :d] @ placement.rotation,
    )
    away = np.hypot(_distance(grain, x), np.linalg.norm(contacts.points[:, d:], axis=1))
    if (away > tolerance).any():
        k = int(np.argmax(away > tolerance))
        raise SceneError(
            f"contacts: point {k} is {away[k]:.3g} off the grain; move it onto the surface"
        )
    inward = (grain.normal(x) * normals).sum(axis=1) < 0.0
    if inward.any():
        raise SceneError(
            f"contacts: normal {int(np.argmax(inward))} points into the grain; turn it round"
        )


def _distance(grain: Grain | Solid, x: Floats) -> Floats:
    """How far points (n, gdim) near the surface are from it, to first order: f / |grad f|."""
    h = 1e-6 * grain.size
    rises = [grain.level(x + h * e) - grain.level(x - h * e) for e in np.eye(grain.gdim)]
    slope = np.array(rises) / (2.0 * h)
    # In a sharp edge the differences of two sides partly cancel; distances of at least f remain.
    return np.asarray(np.abs(grain.level(x)) / np.clip(np.linalg.norm(slope, axis=0), 1e-3, None))


def _planar(grain: Grain, placement: Placement, bed: Bed, tolerance: float) -> Contacts:
    """The contacts in the plane."""
    patches = _patches(grain, placement, bed, tolerance)
    contacts: list[Contact] = [  # the ends of the patches, each with half its length
        (point, normal, 0.5 * float(np.linalg.norm(ends[1] - ends[0])))
        for ends, normal in patches
        for point in ends
    ]
    for approach in approaches(grain, placement, bed, tolerance):
        if approach.distance <= tolerance:
            for normal in contact_normals(approach, bed, tolerance):
                if not _is_repeated(approach.on_grain, normal, contacts, patches, tolerance):
                    contacts.append((approach.on_grain, normal, 0.0))
    if not contacts:
        raise SceneError(
            f"the grain does not touch the bed within {tolerance:g}; rest it on the bed with x"
        )
    points, normals, areas = (np.array(column) for column in zip(*contacts, strict=True))
    return Contacts(spatial(points), spatial(normals), areas if patches else None)


def _patches(grain: Grain, placement: Placement, bed: Bed, tolerance: float) -> list[Patch]:
    """All straight sides, or parts of them, that lie on straight pieces of the bed."""
    outline = placed_outline(grain, placement)
    near = (outline[int(k)] for k in outline.near(bed, tolerance))
    sides = [curve for curve in near if isinstance(curve, Line)]
    centre, reach = placement.centre[0], grain.size
    x0, x1 = max(centre - reach, bed.extent[0]), min(centre + reach, bed.extent[1])
    if not sides or x0 >= x1:
        return []
    pieces = [curve for curve in bed.curves(x0, x1) if isinstance(curve, Line)]
    patches: list[Patch] = []
    for side in sides:
        for piece in pieces:
            patch = _patch(side, piece, tolerance)
            if patch is not None:
                patches = _joined(patches, patch, tolerance)
    return patches


def _joined(patches: list[Patch], patch: Patch, tolerance: float) -> list[Patch]:
    """The patches with one more, grown together with the last if it continues that one straight on."""
    if patches and _same(patches[-1][1], patch[1], SAME_DIRECTION):
        ends = np.vstack([patches[-1][0], patch[0]])
        apart = np.linalg.norm(ends[:2, None] - ends[None, 2:], axis=2)
        if apart.min() <= tolerance:
            i, j = np.unravel_index(np.argmax(apart), apart.shape)
            return [*patches[:-1], (ends[[i, 2 + j]], patch[1])]
    return [*patches, patch]


def _patch(side: Line, piece: Line, tolerance: float) -> Patch | None:
    """The part of a grain's side above a piece of bed, if all of that part is within the tolerance."""
    x = side.start[0], side.end[0]
    if max(x) < piece.start[0] - tolerance or min(x) > piece.end[0] + tolerance:
        return None
    along, forward = piece.tangent([0.0])[0], side.tangent([0.0])[0]
    upward, outward = quarter_turned(along), -quarter_turned(forward)
    if outward @ upward > -0.5:
        return None
    at = (np.array([side.start, side.end]) - np.asarray(piece.start)) @ along
    low, high = max(at.min(), 0.0), min(at.max(), piece.length)
    if high - low <= max(tolerance, 1e-9 * side.length):
        return None
    ends = side.point((np.array([low, high]) - at[0]) / (at[1] - at[0]))
    if np.abs((ends - np.asarray(piece.start)) @ upward).max() > tolerance:
        return None
    return ends, outward


def contact_normals(approach: Approach, bed: Bed, tolerance: float) -> list[Floats]:
    """The grain's outward normals at a point contact: two where it stands in the corner of a valley."""
    if approach.normal is not None:
        return [approach.normal]
    x = approach.on_bed[0]
    corners = bed.corners(x - tolerance, x + tolerance)
    at = corners[:1] if len(corners) else np.array([x])
    left, right = bed.side_normals(at)
    steepening = planar_cross(left[0], right[0])
    if steepening > SAME_DIRECTION:
        return [-left[0], -right[0]]
    return [-bed.normal(at)[0]]


def _is_repeated(
    point: Floats, normal: Floats, contacts: list[Contact], patches: list[Patch], tolerance: float
) -> bool:
    """Whether a point contact was found before, or lies on a patch."""
    if any(
        _same(point, at, tolerance) and _same(normal, n, SAME_DIRECTION) for at, n, _ in contacts
    ):
        return True
    return any(
        _same(normal, outward, SAME_DIRECTION)
        and (ends[0] - point) @ (ends[1] - point) < 0.0
        and abs((ends[0] - point) @ outward) <= 2.0 * tolerance
        for ends, outward in patches
    )


def _same(a: Floats, b: Floats, tolerance: float) -> bool:
    return bool(np.abs(a - b).max() <= tolerance)
