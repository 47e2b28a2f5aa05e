"""The tables of `incipient/geometry/plane/beds.py`, by boundary elements: prints both, in about a minute.

    python benchmarks/effective_level.py

Far above a bed that repeats, flow of unit shear is u = y - d, and d is the effective level (the crests less the
protrusion height of Luchini, Manzo & Pozzi 1991). The flow over one period is that of a layer of point forces on the
bed (Pozrikidis 1992, Boundary Integral and Singularity Methods, chapter 3), with the fluid below at rest.
"""

from collections.abc import Sequence

import numpy as np

from incipient.arrays import Floats
from incipient.geometry import Curve, HalfDiscs, Sinusoidal

PANELS = 512  # on a period; the level then errs by less than 1e-5 of the period
FEWEST = 3  # on a curve of the bed
ABSCISSAE, WEIGHTS = np.polynomial.legendre.leggauss(4)


def main() -> None:
    """Print depths of the effective level below the crests over the height of these."""
    places = np.linspace(0.05, 1.0, 20)
    print("half-discs, diameters of 0.05, 0.1, ..., 1 spacings:")
    rows = (HalfDiscs(0.5 * q, 1.0).curves(-0.5, 0.5) for q in places)
    print([round(-level(row) / (0.5 * q), 6) for row, q in zip(rows, places, strict=True)])
    print("sinusoidal, s = 0.05, 0.1, ..., 0.95 of amplitudes s / (10 (1 - s)) wavelengths:")
    heights = [0.1 * s / (1.0 - s) for s in places[:-1]]
    waves = (Sinusoidal(a, 1.0).curves(0.0, 1.0) for a in heights)
    print([round(-level(wave) / a, 6) for wave, a in zip(waves, heights, strict=True)])


def level(curves: Sequence[Curve]) -> float:
    """The effective level of one period, of length one, of a bed, counted from its crests."""
    ends, middles = _panels(curves)
    highest = max(ends[..., 1].max(), middles[:, 1].max())
    # From the crests, near which the forces are, so that no sum is of large numbers.
    foot = np.array([curves[0].start[0], highest])
    return _level(ends - foot, middles - foot)


def _panels(curves: Sequence[Curve]) -> tuple[Floats, Floats]:
    """Ends (n, 2, 2) and middles (n, 2) of panels, short towards the ends of curves, where the stress may be large."""
    whole, ends, middles = sum(curve.length for curve in curves), [], []
    for curve in curves:
        count = max(FEWEST, round(PANELS * curve.length / whole))
        s = 0.5 - 0.5 * np.cos(np.pi * np.arange(count + 1) / count)
        points = curve.point(s)
        ends.append(np.stack([points[:-1], points[1:]], axis=1))
        middles.append(curve.point(0.5 * (s[1:] + s[:-1])))
    return np.concatenate(ends), np.concatenate(middles)


def _level(ends: Floats, middles: Floats) -> float:
    """d for a period of one, from panels: half of the unit shear is theirs, the other half is given.

    The forces make the fluid rest on the panels; together they are the drag of unit shear, which leaves none below.
    Pressure within the bed is free: forces along the normal that do nothing are shut out.
    """
    count, along = len(middles), ends[:, 1] - ends[:, 0]
    length = np.hypot(*along.T)
    normal = np.column_stack([-along[:, 1], along[:, 0]]) / length[:, None]
    size = 2 * count
    matrix, right = np.zeros((size + 2, size + 2)), np.zeros(size + 2)
    matrix[:size, :size] = _velocities(ends, middles) / (4.0 * np.pi)
    matrix[:count, size] = 1.0  # a uniform stream
    matrix[:size, size + 1] = normal.T.ravel() / count
    matrix[size, :count], right[size] = length, -1.0
    matrix[size + 1, :size] = (normal * length[:, None]).T.ravel()
    right[:count] = -0.5 * middles[:, 1]
    result = np.linalg.solve(matrix, right)
    drag = result[:count] * length
    return float(-result[size] - drag.sum() / (4.0 * np.pi) - 0.5 * drag @ middles[:, 1])


def _velocities(ends: Floats, middles: Floats) -> Floats:
    """4 pi viscosity times the velocity (2n, 2n) at the middles that unit forces along the panels cause."""
    start, end, count = ends[:, 0], ends[:, 1], len(middles)
    matrix = np.zeros((2, count, 2, count))
    for at, weight in zip(ABSCISSAE, WEIGHTS, strict=True):
        # On the parabola through start, middle and end.
        point = (
            0.5 * at * (at - 1.0) * start + (1.0 - at * at) * middles + 0.5 * at * (at + 1.0) * end
        )
        rate = np.hypot(*((at - 0.5) * start - 2.0 * at * middles + (at + 0.5) * end).T)
        matrix += weight * _periodic(middles[:, None] - point) * rate
    own, along = np.arange(count), end - start
    length = np.hypot(*along.T)
    direction = along / length[:, None]
    # A panel's own: minus the mean of the logarithm, in closed form, and what goes along and across.
    itself = -length * (np.log(np.pi * length) - 1.0)
    for i in range(2):
        for j in range(2):
            matrix[i, own, j, own] = (i == j) * itself + length * direction[:, i] * direction[:, j]
    return matrix.reshape(2 * count, 2 * count)


def _periodic(away: Floats) -> Floats:
    """The velocity (2, n, 2, m) at distances (n, m, 2) from point forces one apart in x (Pozrikidis 1992, 2.10)."""
    x, y = 2.0 * np.pi * away[..., 0], 2.0 * np.pi * away[..., 1]
    fading = np.exp(-np.abs(y))
    # 2 (cosh y - cos x) exp(-|y|), without loss of digits near the force.
    apart = np.expm1(-np.abs(y)) ** 2 + 4.0 * fading * np.sin(0.5 * x) ** 2
    potential = 0.5 * (np.abs(y) + np.log(apart))
    by_x, by_y = np.sin(x) * fading / apart, -0.5 * np.sign(y) * np.expm1(-2.0 * np.abs(y)) / apart
    rows = [[1.0 - potential - y * by_y, y * by_x], [y * by_x, y * by_y - potential]]
    return np.moveaxis(np.array(rows), 1, 2)


if __name__ == "__main__":
    main()
