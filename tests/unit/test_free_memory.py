"""How much memory is free, beside what Linux tells of the machine."""

from pathlib import Path

import pytest

from incipient.installed import free_bytes


def test_no_more_is_free_than_the_system_has_and_what_files_take_counts():
    """MemAvailable is what may be taken without swapping; MemFree leaves out what files take (proc(5))."""
    lines = Path("/proc/meminfo").read_text().splitlines()
    told = {line.split(":")[0]: 1024 * float(line.split()[1]) for line in lines}
    assert 0.0 < free_bytes() <= told["MemTotal"]
    if not Path("/sys/fs/cgroup/memory.max").exists():
        assert free_bytes() == pytest.approx(told["MemAvailable"], rel=0.2)
