"""Closing of the interstice between a resting grain and its bed in 2-D.

Wedges next to contacts are left out where narrower than some width, up to a straight line across each.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from incipient.arrays import Floats
from incipient.errors import SceneError
from incipient.geometry.plane.beds import Bed
from incipient.geometry.plane.curves import Curve, Line, part, plain

FEWEST, MOST, PER_WIDTH = 64, 4096, 8.0  # samples along a curve, and how many within a width


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
    """Close the space between an outline, counter-clockwise in scene coordinates, and a bed that it touches.

    contacts: (k, 2) points at or next to the outline, in any order

    Raises SceneError if the space is nowhere wider than `width`.
    """
    from scipy.optimize import brentq  # which takes time to import

    samples = [
        np.linspace(0.0, 1.0, int(np.clip(PER_WIDTH * curve.length / width, FEWEST, MOST)))
        for curve in outline
    ]
    # Places are the number of a curve and the parameter on it in one, counted from the highest, beyond all contacts.
    place = np.concatenate([k + s for k, s in enumerate(samples)])
    points = np.vstack([curve.point(s) for curve, s in zip(outline, samples, strict=True)])
    top = int(np.argmax(points[:, 1]))
    place, points = (
        np.append(place[top:], place[:top] + len(outline)),
        np.roll(points, -top, axis=0),
    )
    at = np.array([np.argmin(np.linalg.norm(points - x[:2], axis=1)) for x in contacts])
    wide = bed.distance(points) > width
    before, after = np.flatnonzero(wide[: at.min()]), at.max() + np.flatnonzero(wide[at.max() :])
    if not len(before) or not len(after):
        raise SceneError(
            "contact.gap: the space between grain and bed is nowhere wider; give a smaller one"
        )

    def excess(place: float) -> float:
        return float(bed.distance(_at(outline, place)[None])[0]) - width

    k = before[-1], after[0] - 1
    low, high = (brentq(excess, place[i], place[i + 1], xtol=1e-12) for i in k)
    low, high = _without_crumbs(outline, low, -1, width), _without_crumbs(outline, high, 1, width)
    ends = [_at(outline, end) for end in (low, high)]
    left, right = (Line(plain(bed.nearest(end[None])[0]), plain(end)) for end in ends)
    rest = _pieces(outline, high, low + len(outline))
    return Closing(width, left, right, rest, np.asarray(contacts)[np.argsort(at, kind="stable")])


def _without_crumbs(outline: Sequence[Curve], place: float, sense: int, width: float) -> float:
    joint = float(sense * np.ceil(sense * place))
    left = abs(joint - place) * outline[int(place) % len(outline)].length
    return joint if left < 0.02 * width else place  # shorter ends of curves are left out


def _at(outline: Sequence[Curve], place: float) -> Floats:
    k = int(place)
    return np.asarray(outline[k % len(outline)].point([place - k])[0])


def _pieces(outline: Sequence[Curve], first: float, last: float) -> tuple[Curve, ...]:
    result = []
    for k in range(int(first), int(np.ceil(last))):
        low, high = max(first - k, 0.0), min(last - k, 1.0)
        if high > low:
            whole = outline[k % len(outline)]
            result.append(whole if (low, high) == (0.0, 1.0) else part(whole, low, high))
    return tuple(result)
