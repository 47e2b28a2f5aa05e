"""Rigid beds y = b(x): the height, the normal into the fluid, the nearest point, and exact curves to mesh.

Every bed takes `origin_y`, the height of its base line in the scene. Lengths are scene units, angles radians.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from incipient.arrays import Floats, rows
from incipient.errors import SceneError
from incipient.geometry.plane.curves import Arc, Curve, Line, Spline
from incipient.geometry.shape import require_not_negative, require_positive


class Bed(ABC):
    """A rigid surface y = b(x) below the fluid, for all x."""

    gdim = 2  # dimension of the space it lies in
    origin_y: float

    @property
    @abstractmethod
    def feature(self) -> float:
        """The smallest horizontal length of the bed's shape, for choosing numbers of samples (inf: none)."""

    @property
    def extent(self) -> tuple[float, float]:
        """The abscissae between which `curves` can be asked for."""
        return -np.inf, np.inf

    @abstractmethod
    def height(self, x: ArrayLike) -> Floats:
        """b at abscissae (n,), (n,)."""

    @property
    @abstractmethod
    def crest(self) -> float:
        """A height that the bed nowhere exceeds."""

    def crest_level(self, x0: float, x1: float) -> float:
        """The height that the crests reach from x0 to x1; it does not depend on where these cut a bed that repeats."""
        return self.crest

    def mean(self, x0: float, x1: float) -> float:
        """The mean height over a period; that from x0 to x1 of a bed that does not repeat."""
        return self.origin_y

    @abstractmethod
    def slopes(self, x: ArrayLike) -> tuple[Floats, Floats]:
        """db/dx just left and just right of the abscissae (n,); they differ at corners; may be infinite."""

    def corners(self, x0: float, x1: float) -> Floats:
        """Abscissae in [x0, x1] at which the bed has a corner, ascending; by default none."""
        return np.empty(0)

    @abstractmethod
    def nearest(self, points: Floats) -> Floats:
        """The point of the bed nearest to each of the points (n, 2) in the fluid, (n, 2)."""

    @abstractmethod
    def curves(self, x0: float, x1: float) -> tuple[Curve, ...]:
        """The bed from x0 to x1 > x0 as curves, left to right, each beginning where the one before ends."""

    @property
    def period(self) -> float | None:
        """The length after which the bed repeats; None where it does not, or has no forms."""
        return None

    def cell(self, x0: float, x1: float) -> tuple[Curve, ...]:
        """The bed over a period from y = 0 as its base line, left to right, wherever it begins in the scene.

        For a bed that does not repeat it is x0 to x1, and the same mirrored at x1.
        """
        raise NotImplementedError

    def normal(self, x: ArrayLike) -> Floats:
        """Unit normals into the fluid at abscissae (n,), (n, 2); at a corner the bisector."""
        left, right = self.side_normals(x)
        total = left + right
        length = np.linalg.norm(total, axis=1, keepdims=True)
        # In a cusp, where two half-discs touch, the sides face each other and the bisector is vertical.
        return np.where(length > 1e-12, total / np.maximum(length, 1e-300), [0.0, 1.0])

    def side_normals(self, x: ArrayLike) -> tuple[Floats, Floats]:
        """Unit normals into the fluid just left and just right of abscissae (n,), (n, 2) each."""
        left, right = (np.arctan(slope) for slope in self.slopes(x))
        return _upward(left), _upward(right)

    def distance(self, points: Floats) -> Floats:
        """The Euclidean distance of points (n, 2) from the bed, (n,), negative below it."""
        points = rows(points)
        length = np.linalg.norm(points - self.nearest(points), axis=1)
        return np.where(points[:, 1] < self.height(points[:, 0]), -length, length)


@dataclass(frozen=True)
class Flat(Bed):
    """The plane y = origin_y; an inclined bed is this one with gravity turned."""

    feature = np.inf
    origin_y: float = 0.0

    @property
    def crest(self) -> float:
        """`origin_y`."""
        return self.origin_y

    def height(self, x: ArrayLike) -> Floats:
        """`origin_y` everywhere, (n,)."""
        return np.full(abscissae(x).shape, float(self.origin_y))

    def slopes(self, x: ArrayLike) -> tuple[Floats, Floats]:
        """Zero slopes on both sides."""
        zero = np.zeros(abscissae(x).shape)
        return zero, zero

    def nearest(self, points: Floats) -> Floats:
        """The point straight below."""
        x = rows(points)[:, 0]
        return np.column_stack([x, self.height(x)])

    def curves(self, x0: float, x1: float) -> tuple[Curve, ...]:
        """One line."""
        require_order(x0, x1)
        return (Line((float(x0), float(self.origin_y)), (float(x1), float(self.origin_y))),)


@dataclass(frozen=True)
class Sinusoidal(Bed):
    """y = origin_y + amplitude sin(2 pi x / wavelength + phase), phase in radians."""

    amplitude: float
    wavelength: float
    phase: float = 0.0
    origin_y: float = 0.0

    def __post_init__(self) -> None:
        require_positive("wavelength", self.wavelength)
        require_not_negative("amplitude", self.amplitude)

    @property
    def feature(self) -> float:
        """Half a wavelength, or the radius of curvature at a crest where that is smaller."""
        curvature = self.amplitude * self._wavenumber**2
        return min(0.5 * self.wavelength, 1.0 / curvature if curvature > 0.0 else np.inf)

    @property
    def crest(self) -> float:
        """The height of the crests."""
        return self.origin_y + self.amplitude

    @property
    def _wavenumber(self) -> float:
        return 2.0 * np.pi / self.wavelength

    @property
    def period(self) -> float | None:
        """The wavelength; None without amplitude."""
        return self.wavelength if self.amplitude else None

    def cell(self, x0: float, x1: float) -> tuple[Curve, ...]:
        """One wavelength."""
        return Sinusoidal(self.amplitude, self.wavelength).curves(0.0, self.wavelength)

    def height(self, x: ArrayLike) -> Floats:
        """b at abscissae (n,), (n,)."""
        angle = self._wavenumber * abscissae(x) + self.phase
        return np.asarray(self.origin_y + self.amplitude * np.sin(angle))

    def slopes(self, x: ArrayLike) -> tuple[Floats, Floats]:
        """The derivative, the same on both sides."""
        k = self._wavenumber
        slope = k * self.amplitude * np.cos(k * abscissae(x) + self.phase)
        return slope, slope

    def nearest(self, points: Floats) -> Floats:
        """The nearest point, within half a wavelength of each abscissa because the bed is periodic."""
        points = rows(points)
        window = np.linspace(-0.55, 0.55, 89) * self.wavelength
        x = points[:, :1] + window
        squared = (x - points[:, :1]) ** 2 + (self.height(x) - points[:, 1:]) ** 2
        bracket = window[1] - window[0]
        # The best samples of up to three valleys: sampling alone could mistake a near tie between valleys.
        valley = (squared[:, 1:-1] <= squared[:, :-2]) & (squared[:, 1:-1] <= squared[:, 2:])
        many = int(np.clip(valley.sum(axis=1).max(initial=1), 1, 3))
        order = np.argsort(np.where(valley, squared[:, 1:-1], np.inf), axis=1)[:, :many]
        order = np.where(np.take_along_axis(valley, order, axis=1), order, order[:, :1])
        starts = np.take_along_axis(x[:, 1:-1], order, axis=1)
        feet = self._refined(points, starts, bracket)
        squared = (feet - points[:, :1]) ** 2 + (self.height(feet) - points[:, 1:]) ** 2
        best = np.take_along_axis(feet, np.argmin(squared, axis=1)[:, None], axis=1)[:, 0]
        return np.column_stack([best, self.height(best)])

    def _refined(self, points: Floats, starts: Floats, bracket: float) -> Floats:
        """Zeros (n, k) of the derivative of the squared distance within `bracket` of the starts (n, k).

        Newton's method where it stays within what is known to enclose the zero, bisection elsewhere.
        """
        x, low, high = starts, starts - bracket, starts + bracket
        for _ in range(40):
            first, second = self._half_slope(points, x)
            low, high = np.where(first < 0.0, x, low), np.where(first > 0.0, x, high)
            newton = x - np.divide(first, second, out=np.full_like(x, np.inf), where=second > 0.0)
            inside = (newton >= low) & (newton <= high)
            before, x = x, np.where(inside, newton, 0.5 * (low + high))
            # What Newton's method moves so little it has squared to round-off; bisection has to get there by itself.
            if (np.abs(x - before) <= np.where(inside, 1e-9, 1e-16) * self.wavelength).all():
                break
        return x

    def _half_slope(self, points: Floats, x: Floats) -> tuple[Floats, Floats]:
        """First two derivatives by x (n, k) of half the squared distance from points (n, 2)."""
        height, slope = self.height(x), self.slopes(x)[0]
        offset, bend = height - points[:, 1:], -(self._wavenumber**2) * (height - self.origin_y)
        return x - points[:, :1] + offset * slope, 1.0 + slope**2 + offset * bend

    def curves(self, x0: float, x1: float) -> tuple[Curve, ...]:
        """One spline, closer to the bed than 1e-6 of the wavelength also in kernels with crude end slopes."""
        require_order(x0, x1)
        # With central differences for slopes a cubic is wrong by 0.016 h^3 b''', at the ends, where mesh
        # generators take the slope of the first chord, by 0.074 h^2 b'': both are held at 2.5e-7 wavelengths.
        steepness = max(self.amplitude / self.wavelength, 1e-3)
        step = min((2.5e-7 / (0.016 * steepness)) ** (1.0 / 3.0), 0.2) / self._wavenumber
        end_step = min((2.5e-7 / (0.074 * steepness)) ** 0.5 / self._wavenumber, step)
        x = _graded(x0, x1, step, end_step)
        return (Spline(np.column_stack([x, self.height(x)])),)


@dataclass(frozen=True)
class HalfDiscs(Bed):
    """A row of half-discs on y = origin_y, one centred at x = offset, the others `spacing` apart."""

    radius: float
    spacing: float
    offset: float = 0.0
    origin_y: float = 0.0

    def __post_init__(self) -> None:
        require_positive("radius", self.radius)
        require_positive("spacing", self.spacing)
        if self.spacing < 2.0 * self.radius * (1.0 - 1e-12):
            raise SceneError(
                f"spacing {self.spacing} of the half-discs is below their diameter {2.0 * self.radius}; "
                "they would overlap: enlarge spacing or reduce radius"
            )

    @property
    def feature(self) -> float:
        """The radius."""
        return self.radius

    @property
    def crest(self) -> float:
        """The top of the half-discs."""
        return self.origin_y + self.radius

    def mean(self, x0: float, x1: float) -> float:
        """The mean height over a period."""
        return self.origin_y + 0.5 * np.pi * self.radius**2 / self.spacing

    @property
    def period(self) -> float:
        """The spacing."""
        return self.spacing

    def cell(self, x0: float, x1: float) -> tuple[Curve, ...]:
        """One half-disc with half of the base line to either side of it."""
        return HalfDiscs(self.radius, self.spacing).curves(-0.5 * self.spacing, 0.5 * self.spacing)

    @property
    def _touching(self) -> bool:
        """Whether the half-discs leave no base line between them."""
        return self.spacing - 2.0 * self.radius <= 1e-9 * self.radius

    def _centre(self, x: Floats) -> Floats:
        """Abscissae of the nearest half-discs' centres."""
        return np.asarray(self.offset + self.spacing * np.round((x - self.offset) / self.spacing))

    def _centres(self, x0: float, x1: float) -> Floats:
        """Abscissae of all half-discs that reach between x0 and x1, and of some beyond."""
        first = np.floor((x0 - self.offset) / self.spacing) - 1
        last = np.ceil((x1 - self.offset) / self.spacing) + 1
        return np.asarray(self.offset + self.spacing * np.arange(first, last + 1))

    def height(self, x: ArrayLike) -> Floats:
        """b at abscissae (n,), (n,)."""
        x = abscissae(x)
        off_centre = np.minimum(np.abs(x - self._centre(x)), self.radius)
        return np.asarray(
            self.origin_y + np.sqrt((self.radius - off_centre) * (self.radius + off_centre))
        )

    def slopes(self, x: ArrayLike) -> tuple[Floats, Floats]:
        """db/dx left and right; infinite where a half-disc stands on the base line."""
        x = abscissae(x)
        away = x - self._centre(x)
        # A foot of a half-disc found to round-off is that foot.
        away = np.where(
            np.isclose(np.abs(away), self.radius, rtol=1e-12), np.copysign(self.radius, away), away
        )
        with np.errstate(divide="ignore", invalid="ignore"):
            slope = np.where(
                np.abs(away) <= self.radius, -away / np.sqrt(self.radius**2 - away**2), 0.0
            )
        if self._touching:
            at_foot = np.abs(away) == self.radius
            return np.where(at_foot, -np.inf, slope), np.where(at_foot, np.inf, slope)
        return np.where(away == -self.radius, 0.0, slope), np.where(away == self.radius, 0.0, slope)

    def corners(self, x0: float, x1: float) -> Floats:
        """The feet of the half-discs."""
        centres = self._centres(x0, x1)
        feet = np.sort(np.concatenate([centres - self.radius, centres + self.radius]))
        if self._touching:
            feet = feet[::2]
        return np.asarray(feet[(feet >= x0) & (feet <= x1)])

    def nearest(self, points: Floats) -> Floats:
        """The foot on the half-disc whose centre is nearest, or that on the base line beside it if it is nearer."""
        points = rows(points)
        x = points[:, 0]
        # Half-way between two it is the left one.
        centre = self.offset + self.spacing * np.ceil((x - self.offset) / self.spacing - 0.5)
        feet = self._on_disc(points, centre)
        if self._touching:
            return feet
        left = np.where(
            x < centre, centre - self.spacing, centre
        )  # of the base line next to the point
        base_x = np.clip(x, left + self.radius, left + self.spacing - self.radius)
        base = np.column_stack([base_x, np.full(len(points), self.origin_y)])
        is_nearer = np.square(base - points).sum(axis=1) < np.square(feet - points).sum(axis=1)
        return np.where(is_nearer[:, None], base, feet)

    def _on_disc(self, points: Floats, centre: Floats) -> Floats:
        """Nearest points on the half-discs with the given centres."""
        away = points - np.column_stack([centre, np.full(len(points), self.origin_y)])
        away[:, 1] = np.maximum(away[:, 1], 0.0)
        length = np.linalg.norm(away, axis=1, keepdims=True)
        direction = np.where(length > 0.0, away / np.where(length > 0.0, length, 1.0), [0.0, 1.0])
        return (
            np.column_stack([centre, np.full(len(points), self.origin_y)]) + self.radius * direction
        )

    def curves(self, x0: float, x1: float) -> tuple[Curve, ...]:
        """Quarter arcs, joined by lines where the half-discs leave room; cut at x0 and x1."""
        require_order(x0, x1)
        crests = self._centres(x0, x1)
        sliver = 1e-9 * self.radius
        stations = abscissae_between(x0, x1, np.concatenate([self.corners(x0, x1), crests]), sliver)
        # The height is so steep at a foot that a cut there must be set on the base line, not computed.
        at_foot = np.abs(np.abs(stations - self._centre(stations)) - self.radius) <= sliver
        heights = np.where(at_foot, self.origin_y, self.height(stations)).tolist()
        curves: list[Curve] = []
        for k in range(len(stations) - 1):
            start, end = (float(stations[k]), heights[k]), (float(stations[k + 1]), heights[k + 1])
            middle = 0.5 * (start[0] + end[0])
            centre = float(self._centre(np.array(middle)))
            on_disc = abs(middle - centre) < self.radius
            curves.append(
                Arc(start, (centre, float(self.origin_y)), end) if on_disc else Line(start, end)
            )
        return tuple(curves)


def abscissae(x: ArrayLike) -> Floats:
    """Abscissae as an array of floats."""
    return np.asarray(x, dtype=float)


def _upward(angle: Floats) -> Floats:
    """Unit normals (n, 2) of lines at the angles (n,) to the horizontal."""
    angle = np.atleast_1d(angle)
    return np.column_stack([-np.sin(angle), np.cos(angle)])


def abscissae_between(x0: float, x1: float, between: Floats, sliver: float) -> Floats:
    """x0, the abscissae `between` that keep `sliver` away from both ends, and x1; ascending."""
    inner = between[(between > x0 + sliver) & (between < x1 - sliver)]
    return np.concatenate([[x0], np.unique(inner), [x1]])


def _graded(x0: float, x1: float, step: float, end_step: float) -> Floats:
    """Abscissae from x0 to x1 at most `step` apart, `end_step` at both ends, growing by 2% a step."""
    count = int(np.ceil(np.log(step / end_step) / np.log(1.02)))
    growing = end_step * 1.02 ** np.arange(count)
    middle = max(int(np.ceil((x1 - x0 - 2.0 * growing.sum()) / step)), 4)
    x = np.concatenate(
        [[0.0], np.cumsum(np.concatenate([growing, np.full(middle, step), growing[::-1]]))]
    )
    x = x0 + (x1 - x0) * (x / x[-1])
    x[-1] = x1
    return np.asarray(x)


def require_order(x0: float, x1: float) -> None:
    """Refuse a piece of bed that does not go from left to right. Raises SceneError."""
    if not x0 < x1:
        raise SceneError(f"a piece of bed from x = {x0} to {x1} is empty; give x0 < x1")
