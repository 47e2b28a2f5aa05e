"""What the benchmarks ran on: enough to judge the times by, nothing that names the machine."""

from __future__ import annotations

import os
import platform
import re
import sys
from pathlib import Path
from typing import Any

from measure import last_line, measure

VERSIONS = """
import gmsh, json
from incipient import compat
print(json.dumps({**compat.versions(), "gmsh": gmsh.__version__}))
"""


def describe() -> dict[str, Any]:
    """Processor, cores, memory, system."""
    processor = re.search(r"model name\s*: (.*)", Path("/proc/cpuinfo").read_text())
    system = platform.freedesktop_os_release().get("PRETTY_NAME", "Linux")
    pages = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    return {
        "processor": processor[1] if processor else platform.machine(),
        "cores": os.cpu_count(),
        "memory_gib": round(pages / 2**30),
        "system": f"{system}, Linux {platform.release().split('-')[0]}",
    }


def versions() -> dict[str, str]:
    """Versions of the libraries, in a process of its own."""
    return last_line(measure([sys.executable, "-c", VERSIONS]))
