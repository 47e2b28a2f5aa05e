"""Tables of which ranks have rows: dealt out and fetched again, numbered without gaps, their checksums, their files."""

from __future__ import annotations

import sys
from pathlib import Path

import h5py
import numpy as np
from environment import environment, finished, on_ranks
from mpi4py import MPI

from incipient.tables.hdf5 import reserve, write_rows
from incipient.tables.rows import Numbered, Rows, block, compact

SCRIPT = """
import sys
from mpi4py import MPI
import numpy as np
from incipient.tables.rows import Numbered, compact

comm = MPI.COMM_WORLD
everything = np.sort(np.random.default_rng(1).choice(1000, 300, replace=False))
# Each rank has some of the numbers, the last one none; rank 0 has all, in another order.
mine = [everything[::-1], everything[5:200], everything[:0]][comm.rank]
numbers, total = compact(comm, mine)
assert total == 300
assert np.array_equal(everything[numbers], mine)
given = Numbered(comm, numbers, total)
rows = given.dealt(np.column_stack([mine, -mine]))
assert rows.shape == (300, 2) and len(rows.values) == 100
assert np.array_equal(rows.values[:, 0], everything[rows.first : rows.first + 100])
assert np.array_equal(given.fetched(rows), np.column_stack([mine, -mine]))
comm.barrier()  # none stops with an error, which its exit code would tell
if comm.rank == 0:
    print("right")
"""


def test_rows_are_dealt_and_fetched_on_three_ranks(tmp_path: Path) -> None:
    """Several ranks have the same rows, one has none, and of a thousand numbers 300 are in use."""
    command = [*on_ranks(3), sys.executable, "-c", SCRIPT]
    done = finished(command, 120, env=environment(), cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["right"]


def test_numbers_without_gaps_on_one_rank() -> None:
    numbers, total = compact(MPI.COMM_SELF, np.array([7, 3, 3, 900]))
    assert (numbers.tolist(), total) == ([1, 0, 0, 2], 3)
    rows = Numbered(MPI.COMM_SELF, numbers, total).dealt(np.array([7.0, 3.0, 3.0, 900.0]))
    assert rows.values.tolist() == [3.0, 7.0, 900.0]


def test_blocks_are_equal_and_leave_nothing_out() -> None:
    parts = [block(10, rank, 4) for rank in range(4)]
    assert [i for part in parts for i in range(part.start, part.stop)] == list(range(10))


def table() -> Rows:
    return Rows.whole(np.random.default_rng(2).standard_normal((50, 2, 3)))


def parts(whole: Rows, borders: list[int]) -> list[Rows]:
    return [
        Rows(whole.values[a:b], a, whole.total)
        for a, b in zip([0, *borders], [*borders, 50], strict=True)
    ]


def test_checksums_of_parts_add_up() -> None:
    whole = table()
    for borders in ([10, 20], [0, 49]):
        assert sum(part.checksum() for part in parts(whole, borders)) % 2**64 == whole.checksum()


def test_a_checksum_tells_a_bit_and_an_exchange_of_rows() -> None:
    """The last bit of one number, two rows exchanged, and one row of zeros that stands for another."""
    whole = table()
    changed = [whole.values.copy() for _ in range(3)]
    changed[0][7, 1, 2] = np.nextafter(changed[0][7, 1, 2], np.inf)
    changed[1][[3, 4]] = changed[1][[4, 3]]
    changed[2][0] = 0.0
    assert len({whole.checksum(), *(Rows.whole(values).checksum() for values in changed)}) == 4


def test_parts_written_one_by_one_are_the_table(tmp_path: Path) -> None:
    """In a file that has other datasets, and a table without rows, beside it."""
    whole, empty, path = table(), Rows.whole(np.zeros((0, 3))), tmp_path / "file.h5"
    with h5py.File(path, "w") as file:
        places = {
            "table": reserve(file, "part/table", whole),
            "empty": reserve(file, "empty", empty),
        }
        file["more"] = np.arange(5)
    for part in parts(whole, [10, 20]):
        write_rows(path, places, {"table": part, "empty": empty})
    with h5py.File(path) as file:
        assert np.array_equal(file["part/table"][()], whole.values)
        assert file["empty"].shape == (0, 3)
        assert file["more"][()].tolist() == [0, 1, 2, 3, 4]
