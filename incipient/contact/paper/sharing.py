"""How several equally significant contacts share the answer to a load (the paper's footnote: equally)."""

from itertools import combinations

import numpy as np

from incipient.arrays import Floats

SAME_PLACE = 1e-9  # of the size of the contact surface


def equal_shares(points: Floats, normals: Floats) -> Floats:
    """Equal shares (k,) that sum to one; contacts at one place with one normal count as one between them."""
    size = max(float(np.ptp(points, axis=0).max()), float(np.abs(points).max()), 1e-300)
    apart = np.abs(points[:, None] - points[None]).max(axis=2) > SAME_PLACE * size
    turned = np.abs(normals[:, None] - normals[None]).max(axis=2) > SAME_PLACE
    shares = 1.0 / (~(apart | turned)).sum(axis=1)
    return np.asarray(shares / shares.sum())


def can_vanish(couples: Floats, tolerance: float) -> bool:
    """Whether some sharing makes the sum of shares times `couples` (k, 3) vanish to `tolerance`.

    True if the origin lies in their convex hull; by Caratheodory's theorem rank + 1 of them then suffice.
    """
    rank = int(np.linalg.matrix_rank(couples, tol=tolerance))
    return any(
        _encloses_origin(couples[list(some)], tolerance)
        for size in range(1, min(rank + 1, len(couples)) + 1)
        for some in combinations(range(len(couples)), size)
    )


def _encloses_origin(corners: Floats, tolerance: float) -> bool:
    """Whether the origin is in the simplex of a few corners (k, 3)."""
    scale = max(float(np.abs(corners).max()), tolerance)
    system = np.vstack([corners.T / scale, np.ones(len(corners))])
    shares = np.linalg.lstsq(system, np.array([0.0, 0.0, 0.0, 1.0]), rcond=None)[0]
    rest = np.abs(shares @ corners).max()
    return bool(rest <= tolerance and abs(shares.sum() - 1.0) <= 1e-9 and shares.min() >= -1e-9)
