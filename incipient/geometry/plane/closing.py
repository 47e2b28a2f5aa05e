"""Where the narrow space between a resting grain and its bed is taken to be closed, and what that leaves of both.

In 2-D a grain that touches closes the way below it. The space next to a contact is a wedge; where it is narrower
than some width it is left out, up to a straight line across it on either side of all contacts.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from incipient.arrays import Floats
from incipient.errors import SceneError
from incipient.geometry.plane.beds import Bed
from incipient.geometry.plane.curves import Curve, Line, part, plain

FEWEST, MOST, PER_WIDTH = 64, 4096, 8.0  # samples along a curve, and how many within a width
HALVINGS = 50
CRUMB = 0.02  # of the width: shorter ends of curves are left out


@dataclass(frozen=True, eq=False)
class Closing:
    """A resting grain whose surroundings are closed next to its contacts."""

    width: float  # of the space where it is closed: the length of both lines
    left: Line  # the line from the bed up to the grain, left of all contacts
    right: Line  # the one right of them
    # The rest of the grain's outline, counter-clockwise from the right line to the left one
    outline: tuple[Curve, ...]
    # (k, 2) where the grain touches, in the order in which its outline passes from the left line to the right
    contacts: Floats


def closing(outline: Sequence[Curve], bed: Bed, contacts: Floats, width: float) -> Closing:
    """Close the space between an outline, counter-clockwise and in its place, and a bed that it touches.

    contacts: (k, 2) points of the outline, or next to it, in any order

    Raises SceneError if the space is nowhere wider than `width`.
    """
    count = len(outline)
    tables = [_sampled(curve, width) for curve in outline]
    places = [_nearest(tables, point) for point in contacts]
    # Parameters along the outline count from its highest point, which lies beyond all contacts.
    top = _top(tables)
    along = np.array([(place - top) % count for place in places])
    order = np.argsort(along)
    first, last = (top + float(along[order[k]]) for k in (0, -1))
    low, high = (_wider(outline, bed, tables, start, width) for start in ((first, -1), (last, 1)))
    if low is None or high is None or high - low >= count:
        raise SceneError(
            "contact.gap: the space between grain and bed is nowhere wider; give a smaller one"
        )
    high, low = (
        _without_crumbs(outline, high, width, up=True),
        _without_crumbs(outline, low, width, up=False),
    )
    ends = [_at(outline, place) for place in (low, high)]
    left, right = (Line(plain(bed.nearest(end[None])[0]), plain(end)) for end in ends)
    return Closing(
        width, left, right, _pieces(outline, high, low + count), np.asarray(contacts)[order]
    )


def _sampled(curve: Curve, width: float) -> tuple[Floats, Floats]:
    """Parameters (n,) and points (n, 2) along a curve, dense beside the width."""
    s = np.linspace(0.0, 1.0, int(np.clip(PER_WIDTH * curve.length / width, FEWEST, MOST)))
    return s, curve.point(s)


def _nearest(tables: list[tuple[Floats, Floats]], point: Floats) -> float:
    """The sampled place of an outline, number of the curve and parameter in one, that is nearest to a point."""
    distances = [np.linalg.norm(points - point[:2], axis=1) for _, points in tables]
    k = int(np.argmin([item.min() for item in distances]))
    return k + float(tables[k][0][np.argmin(distances[k])])


def _top(tables: list[tuple[Floats, Floats]]) -> float:
    k = int(np.argmax([points[:, 1].max() for _, points in tables]))
    return k + float(tables[k][0][np.argmax(tables[k][1][:, 1])])


def _wider(
    outline: Sequence[Curve],
    bed: Bed,
    tables: list[tuple[Floats, Floats]],
    start: tuple[float, int],
    width: float,
) -> float | None:
    """The first place along an outline from a start, in a sense, at which the bed is farther than the width."""
    (place, sense), count = start, len(outline)
    inside = place
    for step in range(count + 1):
        k = int(np.floor(place)) + sense * step
        s, points = tables[k % count]
        wide = bed.distance(points) > width
        ahead = (k + s - inside) * sense >= 0.0
        for i in np.flatnonzero(ahead)[::sense]:
            if wide[i]:
                return _crossing(outline, bed, inside, k + float(s[i]), width)
            inside = k + float(s[i])
    return None


def _crossing(
    outline: Sequence[Curve], bed: Bed, inside: float, outside: float, width: float
) -> float:
    """Where between two places the distance from the bed is the width."""
    for _ in range(HALVINGS):
        middle = 0.5 * (inside + outside)
        is_wide = bed.distance(_at(outline, middle)[None])[0] > width
        inside, outside = (inside, middle) if is_wide else (middle, outside)
    return outside


def _without_crumbs(outline: Sequence[Curve], place: float, width: float, up: bool) -> float:
    """The place, or the joint of curves next to it if only a crumb of a curve lies between."""
    joint = float(np.ceil(place) if up else np.floor(place))
    left = abs(joint - place) * outline[int(np.floor(place)) % len(outline)].length
    return joint if left < CRUMB * width else place


def _at(outline: Sequence[Curve], place: float) -> Floats:
    k = int(np.floor(place))
    return np.asarray(outline[k % len(outline)].point([place - k])[0])


def _pieces(outline: Sequence[Curve], first: float, last: float) -> tuple[Curve, ...]:
    """The curves between two places of an outline."""
    result = []
    for k in range(int(np.floor(first)), int(np.ceil(last))):
        low, high = max(first - k, 0.0), min(last - k, 1.0)
        if high > low:
            whole = outline[k % len(outline)]
            result.append(whole if (low, high) == (0.0, 1.0) else part(whole, low, high))
    return tuple(result)
