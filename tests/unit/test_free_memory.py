"""How much memory is free, beside what Linux tells of the machine."""

import ctypes
import platform
from pathlib import Path

import pytest

from incipient.installed import free_bytes, return_freed_memory


def test_no_more_is_free_than_the_system_has_and_what_files_take_counts():
    """MemAvailable is what may be taken without swapping; MemFree leaves out what files take (proc(5))."""
    lines = Path("/proc/meminfo").read_text().splitlines()
    told = {line.split(":")[0]: 1024 * float(line.split()[1]) for line in lines}
    assert 0.0 < free_bytes() <= told["MemTotal"]
    if not Path("/sys/fs/cgroup/memory.max").exists():
        assert free_bytes() == pytest.approx(told["MemAvailable"], rel=0.2)


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="another C library")
def test_memory_that_was_freed_is_returned():
    """Blocks of 100 kB below one that stays: the C library keeps 100 MB of them, but for what is asked back."""
    library = ctypes.CDLL(None)
    library.malloc.restype, library.free.argtypes = ctypes.c_void_p, [ctypes.c_void_p]
    size, count = 100_000, 1000
    blocks = [library.malloc(size) for _ in range(count + 1)]
    for block in blocks:
        ctypes.memset(block, 1, size)
    for block in blocks[:-1]:
        library.free(block)
    kept = resident_bytes()
    return_freed_memory()
    assert kept - resident_bytes() > 0.9 * size * count
    library.free(blocks[-1])


def resident_bytes():
    """Memory that this process has (proc(5))."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(1024 * int(line.split()[1]) for line in lines if line.startswith("VmRSS"))
