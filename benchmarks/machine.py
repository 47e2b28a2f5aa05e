"""What the benchmarks ran on: enough to judge the times by, nothing that names the machine."""

from __future__ import annotations

import json
import os
import platform
import subprocess
import sys
from pathlib import Path
from typing import Any

ASKED = """
import gmsh, json
from incipient import compat
print(json.dumps({**compat.versions(), "gmsh": gmsh.__version__}))
"""


def describe() -> dict[str, Any]:
    """Processor, cores, memory, system."""
    pages = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    return {
        "processor": _processor(),
        "cores": os.cpu_count(),
        "memory_gib": round(pages / 2**30),
        "system": f"{_distribution()}, Linux {platform.release().split('-')[0]}",
    }


def versions() -> dict[str, str]:
    """Versions of the libraries, asked of a process of its own."""
    answer = subprocess.run(
        [sys.executable, "-c", ASKED], check=True, capture_output=True, text=True
    )
    return json.loads(answer.stdout)


def load() -> float:
    """Processes that wanted to run over the last minute: more than a few tenths before the start spoil the times."""
    return round(os.getloadavg()[0], 2)


def _processor() -> str:
    for line in Path("/proc/cpuinfo").read_text().splitlines():
        if line.startswith("model name"):
            return line.split(":", 1)[1].strip()
    return platform.machine()


def _distribution() -> str:
    return platform.freedesktop_os_release().get("PRETTY_NAME", "Linux")
