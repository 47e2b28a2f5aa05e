"""Types of arrays, and the few operations on arrays of vectors that are needed everywhere. Not collective."""

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

# Beyond these sizes products of a few numbers leave what a computer can represent.
LARGEST, SMALLEST = 1e30, 1e-30
MOST_HEIGHTS = 250_000  # of a raster


@contextmanager
def unwarned() -> Iterator[None]:
    """Keeps warnings of Python and numpy from the user while something odd is read, which is refused in words."""
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        yield


def decimal(text: str) -> float:
    """The number that a text is; ValueError where it is none, also for 1_2, which Python takes for 12."""
    if "_" in text or not text.isascii():
        raise ValueError(f'"{text[:40]}" is no plain number')
    return float(text)


def number(cell: Any) -> float:
    """The number in a cell of a table, NaN for an empty cell; ValueError for times, truth values and bytes."""
    if cell is None or cell == "":
        return float("nan")
    if isinstance(cell, str):
        return decimal(cell)
    if isinstance(cell, bool) or not isinstance(cell, int | float | Decimal):
        raise ValueError(f"{type(cell).__name__} is no number")
    return float(cell)


def rows(x: ArrayLike) -> Floats:
    """Points as a table (n, d) of numbers; one point (d,) becomes a table of one row."""
    return np.atleast_2d(np.asarray(x, dtype=np.float64))


def unit(vectors: Floats) -> Floats:
    """Vectors (..., d) at unit length; those of no length stay as they are."""
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-300))


def spatial(vectors: ArrayLike) -> Floats:
    """Vectors (..., 2) or (..., 3) with three components, (..., 3): the third of plane ones is zero."""
    vectors = np.asarray(vectors, dtype=np.float64)
    return np.concatenate(
        [vectors, np.zeros((*vectors.shape[:-1], 3 - vectors.shape[-1]))], axis=-1
    )


def planar_cross(a: Floats, b: Floats) -> Floats:
    """The third component (...) of the vector product of plane vectors (..., 2)."""
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def determinants(a: Floats) -> Floats:
    """Determinants (...) of matrices (d, d, ...) of two or three rows: far faster than factorising each."""
    if len(a) == 2:
        return np.asarray(a[0, 0] * a[1, 1] - a[0, 1] * a[1, 0])
    (a0, a1, a2), (b0, b1, b2), (c0, c1, c2) = a
    return np.asarray(
        a0 * (b1 * c2 - b2 * c1) + a1 * (b2 * c0 - b0 * c2) + a2 * (b0 * c1 - b1 * c0)
    )


def unordered_keys(rows: Integers, base: int) -> Integers:
    """A number (n,) for each of the rows (n, k) of numbers below a base, whatever their order in the row."""
    keys = np.zeros(len(rows), dtype=np.int64)
    for column in np.sort(rows, axis=1).T:
        keys = keys * base + column
    return keys


def cross(a: Floats, b: Floats) -> Floats:
    """The vector product (..., 3) along the last axis; numpy's takes several times as long for a few vectors."""
    ahead, behind = [1, 2, 0], [2, 0, 1]
    return np.asarray(a[..., ahead] * b[..., behind] - a[..., behind] * b[..., ahead])


def quarter_turned(vectors: Floats) -> Floats:
    """Plane vectors (..., 2) turned counter-clockwise by a right angle."""
    return np.stack([-vectors[..., 1], vectors[..., 0]], axis=-1)


def extrapolated(times: Sequence[float], values: Sequence[Floats], time: float) -> Floats:
    """Values (n,) at a time, by the polynomial through those at different times: of second degree for three."""
    result = np.zeros_like(values[0])
    for i, (one, value) in enumerate(zip(times, values, strict=True)):
        others = np.delete(times, i)
        result += np.prod((time - others) / (one - others)) * value
    return result


def percentile(values: ArrayLike, share: float) -> Floats:
    """The least of values (n, ...) that at least `share` percent of them do not exceed, (...); some may be infinite."""
    numbers = np.asarray(values, dtype=float)
    return np.asarray(np.quantile(numbers, share / 100.0, axis=0, method="inverted_cdf"))


def known_percentiles(shares: Sequence[int], count: int) -> list[int]:
    """The percentiles that a sample of this size resolves: with more than one value on their smaller side."""
    return [share for share in shares if count * min(share, 100 - share) > 100]
