"""Numerical loops, interpreted at first and compiled by numba when called often."""

import math
from collections.abc import Callable
from types import FunctionType
from typing import Any

from incipient.arrays import Floats
from incipient.interrupt import handlers_kept

# Rows, of 2 ms in 2-D and 8 ms in 3-D, before compilation: numba takes 0.5 s and 100 MiB to load.
INTERPRETED = 60
# Rows in one call that are always compiled, so that tables do not depend on earlier calls.
AT_ONCE = 20


class Kernel:
    """Function that numba compiles after `interpreted` rows, cached in `__pycache__`."""

    def __init__(self, function: Callable[..., Any], interpreted: float = INTERPRETED) -> None:
        self.function, self.left = function, interpreted
        self.compiled: Callable[..., Any] | None = None

    def __call__(self, *arguments: Any, rows: int = 1) -> Any:
        self.left -= rows
        if (self.left < 0 or rows >= AT_ONCE) and self.compiled is None:
            with handlers_kept():  # the compiler's callbacks would drop an interrupt
                self.compiled = _compiled(self.function) or self.function
                return self.compiled(*arguments)
        return (self.compiled or self.function)(*arguments)


def _compiled(function: Callable[..., Any]) -> Callable[..., Any] | None:
    try:
        from numba import njit  # takes a third of a second
    except ImportError:
        return None
    scope: dict[str, Any] = {}
    for value in list(function.__globals__.values()):
        if isinstance(value, FunctionType) and value.__module__.startswith(__package__):
            scope |= value.__globals__
    scope |= function.__globals__
    options = {"error_model": "numpy", "no_cfunc_wrapper": True, "nogil": True}
    for name, value in list(scope.items()):
        if isinstance(value, FunctionType) and value.__module__.startswith(__package__):
            scope[name] = njit(**options)(FunctionType(value.__code__, scope, name))
    entry = FunctionType(function.__code__, scope, function.__name__)
    entry.__module__ = function.__module__
    try:
        return njit(cache=True, **options)(entry)
    except RuntimeError:  # no writable cache directory
        return njit(**options)(entry)


def dot(a: Floats, b: Floats) -> float:
    """Scalar product."""
    total = 0.0
    for i in range(len(a)):
        total += a[i] * b[i]
    return total


def add(total: Floats, factor: float, vector: Floats) -> None:
    """Add a multiple of a vector in place."""
    for i in range(len(total)):
        total[i] += factor * vector[i]


def length(vector: Floats) -> float:
    """Euclidean norm."""
    return math.sqrt(dot(vector, vector))


def largest(vector: Floats) -> float:
    """Maximum norm."""
    most = 0.0
    for i in range(len(vector)):
        most = max(most, abs(vector[i]))
    return most
