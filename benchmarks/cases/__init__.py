"""The benchmarks: each measures (`measure`) and tells what it found (`describe`)."""

from . import (
    cavity,
    contact,
    cylinder,
    grain,
    memory,
    ranks,
    steep_cavity,
    vortex_street,
)

ALL = {
    "cylinder": cylinder,
    "cavity": cavity,
    "steep_cavity": steep_cavity,
    "vortex_street": vortex_street,
    "grain": grain,
    "ranks": ranks,
    "memory": memory,
    "contact": contact,
}
