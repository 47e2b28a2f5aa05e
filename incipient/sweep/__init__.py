"""Many cases in one file: `incipient sweep`, `incipient table`, and the same from Python.

    import incipient, incipient.sweep
    scene = incipient.load("demos/scenes/reynolds_sweep.toml")
    incipient.sweep.run(scene, "results/curve.sqlite", {"fluid.reynolds": "log:0.1:200:17"}, do="threshold")
    rows = incipient.sweep.rows("results/curve.sqlite")       # a dictionary a case
    frame = incipient.sweep.frame("results/curve.sqlite")     # the same for pandas

docs/howto/sweeps.md says what the file holds and what happens to a sweep that is killed.
"""

from __future__ import annotations

from .call import run
from .live import watching
from .table import frame, rows

__all__ = ["frame", "rows", "run", "watching"]
