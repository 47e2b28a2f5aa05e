"""Many cases in one file: `incipient sweep`, `incipient table`, and the same from Python.

import incipient, incipient.sweep
if __name__ == "__main__":  # worker processes import this file
    incipient.sweep.run("scene.toml", "results/curve.sqlite", {"fluid.reynolds": "log:0.1:200:17"}, do="threshold")
    rows = incipient.sweep.rows("results/curve.sqlite")       # a dictionary for each case
    frame = incipient.sweep.frame("results/curve.sqlite")     # the same for pandas
"""

from __future__ import annotations

from .procedure import run
from .table import frame, rows

__all__ = ["frame", "rows", "run"]
