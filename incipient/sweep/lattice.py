"""The lattice that the values of a sweep span: places between them, and what is set there.

A direction is one key, or several that go along together. Along it values are numbered 0, 1, 2 ...; a place is such a
number or a fraction in between, a sum of powers of two and therefore exact. Between two values of a key are equal
ratios or equal differences, whichever the values given are nearer to.
"""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Floats
from ..errors import SceneError
from .axes import Settings, VariedKey, rounded

_TENFOLD = 10.0  # ratio of two values, if there are no more, from which what is between them has equal ratios


@dataclass(frozen=True, eq=False)
class NumericKey:
    """The values of a key, as texts (n,) and `values` (n, m) of m components on the scale that is interpolated.

    logarithmic: whether that is the logarithm; listed: whether the key takes a list
    """

    key: str
    texts: tuple[str, ...]
    values: Floats
    logarithmic: bool
    listed: bool

    @classmethod
    def of(cls, axis: VariedKey, ordered: bool = False) -> NumericKey | None:
        """The numbers of an axis; None if it has others, or none that differ.

        Single numbers are sorted and each taken once unless they are `ordered`, as of keys that go along together.
        """
        parsed = [_parsed(text) for text in axis.values]
        rows = [one for one in parsed if one is not None]
        if len(rows) < len(parsed) or len({len(row) for row in rows}) > 1 or len(set(rows)) < 2:
            return None
        listed = axis.values[0].startswith("[")
        pairs = list(zip(rows, axis.values, strict=True))
        if not ordered:
            pairs = list(dict(reversed(pairs)).items())[::-1]
            pairs = pairs if listed else sorted(pairs)
        values = np.array([row for row, _ in pairs], dtype=float)
        logarithmic = not listed and _has_equal_ratios(values[:, 0])
        scaled = np.log(values) if logarithmic else values
        return cls(axis.key, tuple(text for _, text in pairs), scaled, logarithmic, listed)

    def setting(self, place: float) -> str:
        """The override at a place."""
        number = int(place)
        if number == place:
            return f"{self.key}={self.texts[number]}"
        between = self.values[number] + (place - number) * (
            self.values[number + 1] - self.values[number]
        )
        shown = [
            rounded(one) for one in (np.exp(between) if self.logarithmic else between).tolist()
        ]
        return f"{self.key}={'[' + ', '.join(shown) + ']' if self.listed else shown[0]}"


@dataclass(frozen=True, eq=False)
class Direction:
    """Keys that go along together; `along` (n,): where their values are, from 0 to 1."""

    keys: tuple[NumericKey, ...]
    along: Floats

    @classmethod
    def of(cls, *keys: NumericKey) -> Direction:
        """The direction of one key by its scale, of several together, or of lists, by the numbers of the values."""
        if len(keys) > 1 or keys[0].listed:
            return cls(keys, np.linspace(0.0, 1.0, len(keys[0].texts)))
        scale = keys[0].values[:, 0]
        return cls(keys, (scale - scale[0]) / (scale[-1] - scale[0]))

    def at(self, place: float) -> float:
        """Position of a place, from 0 to 1."""
        return float(np.interp(place, np.arange(len(self.along)), self.along))

    def settings(self, place: float) -> Settings:
        """The overrides at a place."""
        return tuple(key.setting(place) for key in self.keys)


def directions(axes: Sequence[VariedKey], together: bool) -> list[Direction]:
    """The directions of axes, one or two; axes that are no numbers, or have but one, are left out.

    Raises:
        SceneError: there is no direction or there are more, or axes that go together are not all numbers.
    """
    if together and len(axes) > 1:
        keys = [key for axis in axes if (key := NumericKey.of(axis, ordered=True)) is not None]
        if len(keys) < len(axes):
            missing = next(axis.key for axis in axes if NumericKey.of(axis, ordered=True) is None)
            why = "is varied with other keys and takes no distinct numbers"
            raise SceneError(f"--refine: {missing} {why}; give it by --cases")
        return [Direction.of(*keys)]
    keys = [key for axis in axes if (key := NumericKey.of(axis)) is not None]
    if not keys:
        raise SceneError("--refine: no key is varied over numbers; give --over KEY=FIRST,LAST")
    if len(keys) > 2:
        names = f"{', '.join(key.key for key in keys)} are {len(keys)} keys with numbers"
        raise SceneError(f"--refine: {names}; vary two, the others by --cases")
    return [Direction.of(key) for key in keys]


def _parsed(text: str) -> tuple[float, ...] | None:
    """A number or a list of numbers; None if it is neither."""
    try:
        value = tomllib.loads(f"value = {text}")["value"]
    except (ValueError, RecursionError):
        return None
    parts = value if isinstance(value, list) and value else [value]
    if all(
        isinstance(one, int | float) and not isinstance(one, bool) and np.isfinite(one)
        for one in parts
    ):
        return tuple(map(float, parts))
    return None


def _has_equal_ratios(values: Floats) -> bool:
    """Whether values are nearer to equal ratios than to equal differences."""
    if values.min() <= 0.0:
        return False
    if len(values) == 2:
        return bool(values.max() >= _TENFOLD * values.min())
    uneven = []
    for scaled in (values, np.log(values)):
        gaps = np.abs(np.diff(scaled))
        uneven.append(gaps.max() / gaps.min() if gaps.min() > 0.0 else np.inf)
    return bool(uneven[1] < uneven[0])
