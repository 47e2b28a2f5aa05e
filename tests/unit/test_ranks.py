"""Two ranks give what one gives: forces, couples, norms; steady, unsteady, open and closed."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

SCRIPT = Path(__file__).with_name("ranks_script.py")


@pytest.mark.parametrize("case", ["open", "closed", "unsteady", "in_time", "cubic", "three_dimensions"])
def test_two_ranks_agree_with_one(mpirun: Any, case: str) -> None:
    readings = [_readings(mpirun(n, SCRIPT, case)) for n in (1, 2)]
    assert [r.pop("ranks") for r in readings] == [1, 2]
    alone, together = readings
    for name, value in alone.items():
        scale = np.abs(value).max()
        assert np.asarray(together[name]) == pytest.approx(np.asarray(value), rel=1e-9, abs=1e-9 * scale), (
            name
        )


def _readings(done: Any) -> dict[str, Any]:
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)
