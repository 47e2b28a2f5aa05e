"""The benchmarks: each measures (`measure`) and tells what it measured (`describe`)."""

from typing import Any

from . import contact, grain, memory, races, ranks, steep_cavity, vortex_street

ALL: dict[str, Any] = {
    **races.ALL,
    "steep_cavity": steep_cavity,
    "vortex_street": vortex_street,
    "grain": grain,
    "ranks": ranks,
    "memory": memory,
    "contact": contact,
}
