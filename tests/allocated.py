"""How much memory Python and numpy allocate: the same on every machine, where processor time is not."""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def allocated() -> Iterator[Callable[[], float]]:
    """Yields what gives the largest sum of allocations within the block [MiB], during it or after."""
    tracemalloc.start()
    peaks: list[float] = []
    try:
        yield lambda: max(
            [*peaks, tracemalloc.get_traced_memory()[1] / 2**20 if not peaks else 0.0]
        )
    finally:
        peaks.append(tracemalloc.get_traced_memory()[1] / 2**20)
        tracemalloc.stop()
