"""Types of arrays and operations on arrays of vectors."""

import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from decimal import Decimal
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]
Point = tuple[float, float]  # in 2-D

# Range of magnitudes in which products of a few numbers neither overflow nor underflow.
LARGEST, SMALLEST = 1e30, 1e-30
MOST_HEIGHTS = 250_000  # of a raster
NO_EVENT = (
    3.0  # expected number of events of which none is observed with a probability of 5% (Poisson)
)


@contextmanager
def unwarned() -> Iterator[None]:
    """Suppress warnings while reading input that is checked explicitly."""
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        yield


def decimal(text: str) -> float:
    """Parse a number. Raises ValueError, also for Python's 1_2."""
    if "_" in text or not text.isascii():
        raise ValueError(f'"{text[:40]}" is not a plain number')
    return float(text)


def number(cell: Any) -> float:
    """Number in a cell of a table, NaN if empty. Raises ValueError for other types."""
    if cell is None or cell == "":
        return float("nan")
    if isinstance(cell, str):
        return decimal(cell)
    if isinstance(cell, bool) or not isinstance(cell, int | float | Decimal):
        raise ValueError(f"{type(cell).__name__} is not a number")
    return float(cell)


def rows(x: ArrayLike) -> Floats:
    """Points as a table (n, d); a single point (d,) becomes one row."""
    return np.atleast_2d(np.asarray(x, dtype=np.float64))


def point(x: Any) -> Any:
    """The coordinates (gdim,) as a tuple of plain numbers."""
    return tuple(map(float, x))


def unit(vectors: Floats) -> Floats:
    """Unit vectors (..., d); zero vectors are unchanged."""
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-300))


def spatial(vectors: ArrayLike) -> Floats:
    """Vectors (..., 2) or (..., 3) as (..., 3)."""
    vectors = np.asarray(vectors, dtype=np.float64)
    return np.concatenate(
        [vectors, np.zeros((*vectors.shape[:-1], 3 - vectors.shape[-1]))], axis=-1
    )


def planar_cross(a: Floats, b: Floats) -> Floats:
    """Third component (...) of the cross product of vectors (..., 2)."""
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def determinants(a: Floats) -> Floats:
    """Determinants (...) of matrices (d, d, ...), d = 2 or 3, faster than by factorisation."""
    if len(a) == 2:
        return np.asarray(a[0, 0] * a[1, 1] - a[0, 1] * a[1, 0])
    (a0, a1, a2), (b0, b1, b2), (c0, c1, c2) = a
    return np.asarray(
        a0 * (b1 * c2 - b2 * c1) + a1 * (b2 * c0 - b0 * c2) + a2 * (b0 * c1 - b1 * c0)
    )


def unordered_keys(rows: Integers, base: int) -> Integers:
    """Keys (n,) of rows (n, k) of numbers below a base, whatever the order within a row."""
    keys = np.zeros(len(rows), dtype=np.int64)
    for column in np.sort(rows, axis=1).T:
        keys = keys * base + column
    return keys


def cross(a: Floats, b: Floats) -> Floats:
    """Cross product (..., 3), several times as fast as numpy's for a few vectors."""
    ahead, behind = [1, 2, 0], [2, 0, 1]
    return np.asarray(a[..., ahead] * b[..., behind] - a[..., behind] * b[..., ahead])


def quarter_turned(vectors: Floats) -> Floats:
    """Vectors (..., 2) rotated counter-clockwise by a right angle."""
    return np.stack([-vectors[..., 1], vectors[..., 0]], axis=-1)


def extrapolated(times: Sequence[float], values: Sequence[Floats], time: float) -> Floats:
    """Values (n,) at a time, from the polynomial through values at several times."""
    result = np.zeros_like(values[0])
    for i, (node, value) in enumerate(zip(times, values, strict=True)):
        others = np.delete(times, i)
        result += np.prod((time - others) / (node - others)) * value
    return result


def percentile(values: ArrayLike, share: float) -> Floats:
    """Percentile (...) of values (n, ...), possibly infinite: the least that `share` per cent do not exceed."""
    numbers = np.asarray(values, dtype=float)
    return np.asarray(np.quantile(numbers, share / 100.0, axis=0, method="inverted_cdf"))


def known_percentiles(shares: Sequence[int], count: int) -> list[int]:
    """Percentiles with more than one of `count` values on their smaller side."""
    return [share for share in shares if count * min(share, 100 - share) > 100]
