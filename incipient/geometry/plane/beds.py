"""Rigid beds y = b(x) in 2-D; `origin_y` is the height of the base line in the scene."""

from abc import abstractmethod
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from incipient.arrays import Floats, Point, rows, unit
from incipient.errors import SceneError
from incipient.geometry.plane.curves import (
    Arc,
    Curve,
    Line,
    Spline,
    increasing_roots,
    nearest_on_sides,
    plain,
)
from incipient.geometry.shape import Extent, RigidBed, Sides

# Depth of the effective level below the crests, computed with boundary elements (Pozrikidis 1992, chapter 3; 512 panels
# a period): `python benchmarks/effective_level.py` prints both tables. Cubic interpolation between them errs by less
# than 5e-5 of the height of the crests.
# Depth over the radius, at diameters of 0, 0.05, ..., 1 spacings.
HALF_DISCS = (
    *(1.0, 0.876539, 0.757388, 0.647073, 0.548356, 0.46275, 0.390526, 0.330965, 0.282681),
    *(0.243944, 0.212932, 0.187931, 0.167472, 0.150409, 0.135931, 0.123505, 0.112771, 0.103447),
    *(0.095291, 0.088108, 0.081742),
)
# Depth over the amplitude, at s = 0, 0.05, ..., 1 of amplitudes s / (10 (1 - s)) wavelengths.
SINUSOIDAL = (
    *(1.0, 0.966959, 0.930425, 0.890126, 0.845733, 0.797134, 0.744284, 0.687464, 0.62737),
    *(0.565021, 0.501931, 0.439734, 0.379871, 0.32318, 0.269875, 0.219681, 0.172158, 0.127009),
    *(0.083717, 0.041825, 0.0),
)


class Bed(RigidBed):
    """A rigid surface y = b(x) below the fluid."""

    gdim = 2
    origin_y: float

    def mean(self, x: Sides) -> float:
        """Mean height over a period; of a bed without one over an interval."""
        return self.origin_y

    @abstractmethod
    def slopes(self, x: ArrayLike) -> tuple[Floats, Floats]:
        """db/dx (n,) left and right of abscissae (n,); infinite at a step."""

    def corners(self, x0: float, x1: float) -> Floats:
        return np.empty(0)

    @abstractmethod
    def nearest(self, points: Floats) -> Floats:
        """The nearest points (n, 2) of the bed to points (n, 2) in the fluid."""

    @abstractmethod
    def curves(self, x0: float, x1: float) -> tuple[Curve, ...]:
        """The bed from x0 to x1 > x0 as connected curves, left to right."""

    def normal(self, x: ArrayLike) -> Floats:
        """Unit normals (n, 2) into the fluid at abscissae (n,), at a corner the bisector."""
        left, right = self.side_normals(x)
        total = left + right
        length = np.linalg.norm(total, axis=1, keepdims=True)
        # In a cusp, where two half-discs touch, the sides face each other and the bisector is vertical.
        return np.where(length > 1e-12, total / np.maximum(length, 1e-300), [0.0, 1.0])

    def side_normals(self, x: ArrayLike) -> tuple[Floats, Floats]:
        angles = np.arctan(self.slopes(x))
        left, right = np.stack([-np.sin(angles), np.cos(angles)], axis=-1)
        return left, right

    def distance(self, points: Floats) -> Floats:
        """Signed distance (n,) of points (n, 2), negative below the bed."""
        points = rows(points)
        length = np.linalg.norm(points - self.nearest(points), axis=1)
        return np.where(points[:, 1] < self.height(points[:, 0]), -length, length)


@dataclass(frozen=True)
class Flat(Bed):
    """The plane y = origin_y; on an inclined bed gravity is turned."""

    feature = np.inf
    origin_y: float = 0.0

    @property
    def crest(self) -> float:
        return self.origin_y

    def height(self, x: ArrayLike) -> Floats:
        return np.full(np.asarray(x, dtype=float).shape, float(self.origin_y))

    def slopes(self, x: ArrayLike) -> tuple[Floats, Floats]:
        zero = np.zeros(np.asarray(x, dtype=float).shape)
        return zero, zero

    def nearest(self, points: Floats) -> Floats:
        x = rows(points)[:, 0]
        return np.column_stack([x, self.height(x)])

    def curves(self, x0: float, x1: float) -> tuple[Curve, ...]:
        return (Line((float(x0), float(self.origin_y)), (float(x1), float(self.origin_y))),)


@dataclass(frozen=True)
class Sinusoidal(Bed):
    """y = origin_y + amplitude sin(2 pi x / wavelength + phase), phase in radians."""

    amplitude: float
    wavelength: float
    phase: float = 0.0
    origin_y: float = 0.0

    @property
    def feature(self) -> float:
        curvature = self.amplitude * self._wavenumber**2
        return min(0.5 * self.wavelength, 1.0 / curvature if curvature > 0.0 else np.inf)

    @property
    def crest(self) -> float:
        return self.origin_y + self.amplitude

    @property
    def _wavenumber(self) -> float:
        return 2.0 * np.pi / self.wavelength

    @property
    def period(self) -> float | None:
        return self.wavelength if self.amplitude else None

    def height(self, x: ArrayLike) -> Floats:
        angle = self._wavenumber * np.asarray(x, dtype=float) + self.phase
        return np.asarray(self.origin_y + self.amplitude * np.sin(angle))

    def slopes(self, x: ArrayLike) -> tuple[Floats, Floats]:
        k = self._wavenumber
        slope = k * self.amplitude * np.cos(k * np.asarray(x, dtype=float) + self.phase)
        return slope, slope

    def nearest(self, points: Floats) -> Floats:
        points, window = rows(points), np.linspace(-0.55, 0.55, 89) * self.wavelength
        x = points[:, :1] + window  # samples by which nearest points are bracketed
        squared = window**2 + (self.height(x) - points[:, 1:]) ** 2
        # All valleys: sampling alone could mistake a near tie between them.
        valley = (squared[:, 1:-1] <= squared[:, :-2]) & (squared[:, 1:-1] <= squared[:, 2:])
        owner, k = np.nonzero(valley)
        feet = _foot(self, points[owner], x[owner, k], x[owner, k + 2])
        order = np.lexsort([((feet - points[owner]) ** 2).sum(axis=1), owner])
        return np.asarray(feet[order[np.unique(owner[order], return_index=True)[1]]])

    def curves(self, x0: float, x1: float) -> tuple[Curve, ...]:
        """One spline, within 1e-6 of the wavelength, also in kernels with crude end slopes."""
        # With central differences for slopes a cubic is wrong by 0.016 h^3 b''', at the ends, where mesh
        # generators take the slope of the first chord, by 0.074 h^2 b'': both are held at 2.5e-7 wavelengths.
        steepness = max(self.amplitude / self.wavelength, 1e-3)
        step = min((2.5e-7 / (0.016 * steepness)) ** (1.0 / 3.0), 0.2) / self._wavenumber
        end_step = min((2.5e-7 / (0.074 * steepness)) ** 0.5 / self._wavenumber, step)
        x = _graded(x0, x1, step, end_step)
        return (Spline(np.column_stack([x, self.height(x)])),)


@dataclass(frozen=True)
class HalfDiscs(Bed):
    """Half-discs on y = origin_y, `spacing` apart, one centred at x = offset."""

    radius: float
    spacing: float
    offset: float = 0.0
    origin_y: float = 0.0

    @property
    def feature(self) -> float:
        return self.radius

    @property
    def crest(self) -> float:
        return self.origin_y + self.radius

    def mean(self, x: Sides) -> float:
        return self.origin_y + 0.5 * np.pi * self.radius**2 / self.spacing

    @property
    def period(self) -> float:
        return self.spacing

    @property
    def _touching(self) -> bool:
        return self.spacing - 2.0 * self.radius <= 1e-9 * self.radius

    def _centre(self, x: Floats) -> Floats:
        return np.asarray(self.offset + self.spacing * np.round((x - self.offset) / self.spacing))

    def _centres(self, x0: float, x1: float) -> Floats:
        first = np.floor((x0 - self.offset) / self.spacing) - 1
        last = np.ceil((x1 - self.offset) / self.spacing) + 1
        return np.asarray(self.offset + self.spacing * np.arange(first, last + 1))

    def height(self, x: ArrayLike) -> Floats:
        x = np.asarray(x, dtype=float)
        off_centre = np.minimum(np.abs(x - self._centre(x)), self.radius)
        return np.asarray(
            self.origin_y + np.sqrt((self.radius - off_centre) * (self.radius + off_centre))
        )

    def slopes(self, x: ArrayLike) -> tuple[Floats, Floats]:
        away = np.asarray(x, dtype=float) - self._centre(np.asarray(x, dtype=float))
        # A foot of a half-disc within round-off is that foot.
        foot = np.isclose(np.abs(away), self.radius, rtol=1e-12)
        on_disc = (np.abs(away) < self.radius) & ~foot
        root = np.sqrt(np.where(on_disc, self.radius**2 - away**2, 1.0))
        slope, beside = np.where(on_disc, -away / root, 0.0), np.inf if self._touching else 0.0
        left, right = np.where(away > 0.0, -np.inf, -beside), np.where(away > 0.0, beside, np.inf)
        return np.where(foot, left, slope), np.where(foot, right, slope)

    def corners(self, x0: float, x1: float) -> Floats:
        centres = self._centres(x0, x1)
        sides = (-self.radius,) if self._touching else (-self.radius, self.radius)
        feet = np.sort(np.concatenate([centres + side for side in sides]))
        return np.asarray(feet[(feet >= x0) & (feet <= x1)])

    def nearest(self, points: Floats) -> Floats:
        points, r = rows(points), self.radius
        # Half-way between two it is the left one.
        place = np.ceil((points[:, 0] - self.offset) / self.spacing - 0.5)
        centre = np.column_stack(
            [self.offset + self.spacing * place, np.full(len(points), self.origin_y)]
        )
        away = points - centre
        up = np.column_stack([away[:, 0], np.maximum(away[:, 1], 0.0)])
        up[~up.any(axis=1), 1] = 1.0
        feet = r * unit(up)
        if not self._touching:
            x, side = np.abs(away[:, 0]), np.where(away[:, 0] < 0.0, -1.0, 1.0)
            base = np.column_stack([side * np.clip(x, r, self.spacing - r), np.zeros(len(points))])
            nearer = ((base - away) ** 2).sum(axis=1) < ((feet - away) ** 2).sum(axis=1)
            feet = np.where(nearer[:, None], base, feet)
        return np.asarray(centre + feet)

    def curves(self, x0: float, x1: float) -> tuple[Curve, ...]:
        sliver, curves = 1e-9 * self.radius, list[Curve]()
        x = np.union1d(self.corners(x0, x1), self._centres(x0, x1))
        x = np.array([x0, *x[(x > x0 + sliver) & (x < x1 - sliver)], x1])
        # The height is so steep at a foot that a cut there must be set on the base line, not computed.
        at_foot = np.abs(np.abs(x - self._centre(x)) - self.radius) <= sliver
        stations = np.column_stack([x, np.where(at_foot, self.origin_y, self.height(x))])
        for start, end in pairwise(map(plain, stations)):
            middle = np.array(0.5 * (start[0] + end[0]))
            centre = float(self._centre(middle)), float(self.origin_y)
            on_disc = abs(middle - centre[0]) < self.radius
            curves.append(Arc(start, centre, end) if on_disc else Line(start, end))
        return tuple(curves)


def _foot(bed: Bed, points: Floats, low: Floats, high: Floats) -> Floats:
    def slope(x: Floats) -> Floats:
        return np.asarray(x - points[:, 0] + (bed.height(x) - points[:, 1]) * bed.slopes(x)[0])

    x = increasing_roots(slope, low, high)
    return np.column_stack([x, bed.height(x)])


def _graded(x0: float, x1: float, step: float, end_step: float) -> Floats:
    growing = end_step * 1.02 ** np.arange(np.ceil(np.log(step / end_step) / np.log(1.02)))
    middle = max(int(np.ceil((x1 - x0 - 2.0 * growing.sum()) / step)), 4)
    x = np.append(0.0, np.cumsum([*growing, *np.full(middle, step), *growing[::-1]]))
    return np.append((x0 + (x1 - x0) * (x / x[-1]))[:-1], x1)


@dataclass(frozen=True, init=False)
class Polyline(Bed):
    """Straight lines through `points` (n, 2) with ascending x; y counts from origin_y.

    Two points with the same x are a vertical step, whose x belongs to its right side. Beyond the ends the height is
    constant, but has no `curves`.
    """

    points: tuple[Point, ...]
    origin_y: float = 0.0

    def __init__(self, points: ArrayLike, origin_y: float = 0.0) -> None:
        object.__setattr__(
            self, "points", tuple((float(x), float(y)) for x, y in np.asarray(points))
        )
        object.__setattr__(self, "origin_y", float(origin_y))

    @cached_property
    def _vertices(self) -> Floats:
        return np.array(self.points) + np.array([0.0, self.origin_y])

    @property
    def extent(self) -> Extent:
        return ((self.points[0][0], self.points[-1][0]),)

    @cached_property
    def feature(self) -> float:
        dx, dy = np.abs(np.diff(self._vertices, axis=0)).T
        return float(np.where(dx > 0.0, dx, dy).min())

    @cached_property
    def crest(self) -> float:
        return float(self._vertices[:, 1].max())

    def crest_level(self, *sides: Sides) -> float:
        """Height reached in every third of an interval and at its start: one obstacle does not count."""
        cuts = np.linspace(*sides[0], 4)
        thirds = [self._cut(*cut)[:, 1].max() for cut in pairwise(cuts)]
        return float(max(min(thirds), self.height(cuts[:1])[0]))

    def mean(self, x: Sides) -> float:
        along, y = self._cut(*x).T
        return float(0.5 * (y[1:] + y[:-1]) @ np.diff(along) / (x[1] - x[0]))

    def _cut(self, x0: float, x1: float, sliver: float = 0.0) -> Floats:
        x = self._vertices[:, 0]
        inner = self._vertices[(x > x0 + sliver) & (x < x1 - sliver)]
        first, last = np.column_stack([[x0, x1], self.height([x0, x1])])
        return np.vstack([first, inner, last])

    def height(self, x: ArrayLike) -> Floats:
        return np.asarray(np.interp(np.asarray(x, dtype=float), *self._vertices.T))

    def slopes(self, x: ArrayLike) -> tuple[Floats, Floats]:
        at, (dx, dy) = self._vertices[:, 0], np.diff(self._vertices, axis=0).T
        # No abscissa lies within an upright line.
        slope = np.pad(np.divide(dy, dx, out=np.zeros_like(dx), where=dx > 0.0), 1)
        # A vertex within round-off is that vertex.
        x, slack = np.asarray(x, dtype=float), 1e-12 * np.ptp(at)
        left, right = (
            np.searchsorted(at, x - slack, "left"),
            np.searchsorted(at, x + slack, "right"),
        )
        return slope[left], slope[right]

    def corners(self, x0: float, x1: float) -> Floats:
        x = self._vertices[:, 0]
        return np.unique(x[(x >= x0) & (x <= x1)])

    def nearest(self, points: Floats) -> Floats:
        points = rows(points)
        order = np.argsort(points[:, 0])
        feet = np.empty_like(points)
        # In blocks of neighbours, so that each block meets few lines and the tables stay small.
        for block in np.array_split(order, 1 + len(points) // 64):
            feet[block] = self._nearest(points[block])
        return feet

    def _nearest(self, points: Floats) -> Floats:
        if len(points) == 0:
            return points
        v = self._vertices
        reach = float(np.abs(points[:, 1] - self.height(points[:, 0])).max()) + 1e-9 * np.ptp(
            v[:, 0]
        )
        x0, x1 = points[:, 0].min() - reach, points[:, 0].max() + reach
        ends = [min(x0, v[0, 0]) - reach, v[0, 1]], [max(x1, v[-1, 0]) + reach, v[-1, 1]]
        v = np.vstack([ends[0], v, ends[1]])
        vertices = v[max(np.searchsorted(v[:, 0], x0) - 1, 0) : np.searchsorted(v[:, 0], x1) + 1]
        k, s = nearest_on_sides(points, vertices[:-1], np.diff(vertices, axis=0))
        # Weighted ends: a foot at an end of a line is that end exactly.
        return (1.0 - s)[:, None] * vertices[k] + s[:, None] * vertices[k + 1]

    def curves(self, x0: float, x1: float) -> tuple[Curve, ...]:
        ends = map(plain, self._cut(x0, x1, 1e-9 * (x1 - x0)))
        return tuple(Line(start, end) for start, end in pairwise(ends))


@dataclass(frozen=True, init=False)
class Curved(Polyline):
    """A smooth curve through `knots` (n, 2) with ascending x, y counting from origin_y.

    Piecewise cubic with crests and troughs at knots only (Fritsch & Carlson 1980, SIAM J. Numer. Anal. 17, 238);
    represented by lines between the dense `points`.
    """

    knots: tuple[Point, ...] = ()

    def __init__(self, knots: ArrayLike, origin_y: float = 0.0) -> None:
        object.__setattr__(self, "knots", Polyline(knots).points)
        super().__init__(self._sampled(self.knots[0][0], self.knots[-1][0]), origin_y)

    @cached_property
    def _curve(self) -> Any:
        from scipy.interpolate import PchipInterpolator  # which takes time to import

        return PchipInterpolator(*np.array(self.knots).T)

    @cached_property
    def _longest(self) -> float:
        """Longest horizontal step of its lines."""
        length = self.knots[-1][0] - self.knots[0][0]
        # 300 a radius of curvature, 60 to 20,000 in all
        return min(max(self.feature / 300, length / 20_000), length / 60)

    def _sampled(self, x0: float, x1: float) -> Floats:
        x = np.linspace(x0, x1, 2 + int(np.ceil((x1 - x0) / self._longest)))
        return np.column_stack([x, self._curve(x)])

    @cached_property
    def feature(self) -> float:
        sides = np.diff(np.array(self.knots), axis=0)
        turns = np.abs(np.diff(np.arctan2(sides[:, 1], sides[:, 0])))
        lengths = np.linalg.norm(sides, axis=1)
        curvature = (2.0 * turns / (lengths[1:] + lengths[:-1])).max(initial=0.0)
        # From a million lengths on a radius of curvature is that of a level bed.
        return float(1.0 / curvature) if curvature * 1e6 * sides[:, 0].sum() > 1.0 else np.inf

    @property
    def crest(self) -> float:
        return float(max(y for _, y in self.knots) + self.origin_y)

    def height(self, x: ArrayLike) -> Floats:
        (ends,) = self.extent
        return np.asarray(self._curve(np.clip(np.asarray(x, dtype=float), *ends)) + self.origin_y)

    def slopes(self, x: ArrayLike) -> tuple[Floats, Floats]:
        x, ((left, right),) = np.asarray(x, dtype=float), self.extent
        slope = np.where((x < left) | (x > right), 0.0, self._curve(np.clip(x, left, right), 1))
        return slope, slope

    def corners(self, x0: float, x1: float) -> Floats:
        return np.empty(0)

    def _nearest(self, points: Floats) -> Floats:
        if not len(points) or not np.isfinite(self.feature):
            return super()._nearest(points)
        x = super()._nearest(points)[:, 0]
        return _foot(self, points, x - self._longest, x + self._longest)

    def curves(self, x0: float, x1: float) -> tuple[Curve, ...]:
        return (Spline(self._sampled(x0, x1) + np.array([0.0, self.origin_y])),)


def effective_level(bed: Bed) -> float:
    """Height above the base line of the plane equivalent to a periodic bed for creeping shear far above.

    For unit shear u = y - d far above, d being this level (Luchini, Manzo & Pozzi 1991). Raises SceneError for beds
    without a table.
    """
    if isinstance(bed, HalfDiscs):
        ratio = min(2.0 * bed.radius / bed.spacing, 1.0)
        return float(bed.radius * (1.0 - _depth(HALF_DISCS, ratio)))
    if isinstance(bed, Sinusoidal):
        steepness = 10.0 * bed.amplitude / bed.wavelength
        return float(bed.amplitude * (1.0 - _depth(SINUSOIDAL, steepness / (1.0 + steepness))))
    raise SceneError(
        f'flow.datum: is "effective" over a {type(bed).__name__} bed, of which there is no table; '
        'use "crest", "mean" or a height'
    )


@cache
def _depth(table: tuple[float, ...], place: float) -> float:
    from scipy.interpolate import CubicSpline  # which takes time to import

    return float(CubicSpline(np.linspace(0.0, 1.0, len(table)), table)(place))
