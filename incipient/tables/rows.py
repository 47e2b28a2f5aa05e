"""Tables of which each rank has some rows: dealt out in equal blocks, fetched by number, never whole on one rank."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Integers

if TYPE_CHECKING:
    from mpi4py import MPI

SPREAD = np.uint64(0x9E3779B97F4A7C15)
MIXERS = tuple(np.uint64(number) for number in (0xBF58476D1CE4E5B9, 0x94D049BB133111EB))


@dataclass(frozen=True, eq=False)
class Rows:
    """Consecutive rows (n, ...) of a table of `total` rows, the first one of which has the number `first`."""

    values: NDArray[Any]
    first: int
    total: int

    @classmethod
    def whole(cls, values: ArrayLike) -> Rows:
        """A table that is all here."""
        array = np.asarray(values)
        return cls(array, 0, len(array))

    @property
    def shape(self) -> tuple[int, ...]:
        """The shape of the whole table."""
        return (self.total, *self.values.shape[1:])

    @property
    def nbytes(self) -> int:
        """Bytes of the whole table."""
        return int(np.prod(self.shape, dtype=np.int64)) * self.values.itemsize

    def checksum(self) -> int:
        """A number that changes with any bit of these rows; those of all ranks add up to the table's, modulo 2^64.

        Each eight bytes are mixed with their place by the steps of Steele, Lea & Flood (2014), OOPSLA, 453, and summed.
        """
        words = np.ascontiguousarray(self.values).reshape(-1).view(np.uint64)
        width = int(np.prod(self.shape[1:], dtype=np.int64))
        mixed = np.arange(1, len(words) + 1, dtype=np.uint64) + np.uint64(self.first * width)
        mixed = _mixed(mixed * SPREAD) ^ words
        return int(np.sum(_mixed(mixed), dtype=np.uint64))


def _mixed(words: NDArray[np.uint64]) -> NDArray[np.uint64]:
    for shift, mixer in zip((30, 27), MIXERS, strict=True):
        words = (words ^ (words >> np.uint64(shift))) * mixer
    return words ^ (words >> np.uint64(31))


def block(total: int, rank: int, ranks: int) -> slice:
    """Which of so many rows are a rank's when all ranks have the same number of them, up to one."""
    return slice(total * rank // ranks, total * (rank + 1) // ranks)


class Numbered:
    """Rows that ranks have by global numbers, several of them the same ones, and the same rows in equal blocks.

    Making it is collective, and so is every method. `numbers` (n,) are those of this rank's rows, in any order, of
    `total` on all ranks together.
    """

    def __init__(self, comm: MPI.Comm, numbers: Integers, total: int):
        self.comm, self.total = comm, total
        self._mine = block(total, comm.rank, comm.size)
        bounds = [block(total, rank, comm.size).stop for rank in range(comm.size)]
        owners = np.searchsorted(bounds, numbers, side="right")
        self._order = np.argsort(owners, kind="stable")
        self._sent = np.bincount(owners, minlength=comm.size)
        self._received = np.empty_like(self._sent)
        comm.Alltoall(self._sent, self._received)
        numbers = np.asarray(numbers, dtype=np.int64)
        self._places = (
            self._exchanged(numbers[self._order], self._sent, self._received) - self._mine.start
        )

    def dealt(self, values: NDArray[Any]) -> Rows:
        """Blocks of the rows (n, ...) of all ranks, in the order of their numbers; rows that no rank has are zero."""
        received = self._exchanged(values[self._order], self._sent, self._received)
        found = np.zeros(
            (self._mine.stop - self._mine.start, *values.shape[1:]), dtype=values.dtype
        )
        found[self._places] = received
        return Rows(found, self._mine.start, self.total)

    def fetched(self, rows: Rows) -> NDArray[Any]:
        """This rank's rows (n, ...), by its numbers, of a table in blocks."""
        received = self._exchanged(rows.values[self._places], self._received, self._sent)
        found = np.empty_like(received)
        found[self._order] = received
        return found

    def _exchanged(self, values: NDArray[Any], sent: Integers, received: Integers) -> NDArray[Any]:
        return exchanged(self.comm, values, sent, received)


def exchanged(
    comm: MPI.Comm, values: NDArray[Any], sent: Integers, received: Integers | None = None
) -> NDArray[Any]:
    """Rows (n, ...) from all ranks, in their order; `sent` (ranks,) says how many of these go to each. Collective."""
    from mpi4py import MPI

    if received is None:
        received = np.empty_like(sent)
        comm.Alltoall(sent, received)
    values = np.ascontiguousarray(values)
    found = np.empty((int(received.sum()), *values.shape[1:]), dtype=values.dtype)
    # One row is one thing to MPI, whose counts are short integers.
    row = MPI.BYTE.Create_contiguous(
        values.dtype.itemsize * int(np.prod(values.shape[1:], dtype=np.int64))
    )
    row.Commit()
    comm.Alltoallv([values, _counted(sent), row], [found, _counted(received), row])
    row.Free()
    return found


def _counted(counts: Integers) -> tuple[list[int], list[int]]:
    return counts.tolist(), (np.cumsum(counts) - counts).tolist()


def compact(comm: MPI.Comm, numbers: Integers) -> tuple[Integers, int]:
    """The numbers (n,) that ranks have as 0, 1, 2 ... in the same order, without gaps, and how many. Collective."""
    last = max(comm.allgather(int(numbers.max(initial=-1))))
    given = Numbered(comm, numbers, last + 1)
    there = given.dealt(np.ones(len(numbers), dtype=np.int64))
    count = int(there.values.sum())
    before = sum(comm.allgather(count)[: comm.rank])
    new = Rows(np.cumsum(there.values) - 1 + before, there.first, there.total)
    return np.asarray(given.fetched(new)), comm.allreduce(count)
