"""Scene files at random: each is planned, meshed or run, or refused in one line; none hangs, none gives no number."""

from collections import Counter
from random import Random

import pytest
from random_scenes import NOWHERE, fate, odd_scene_text, scene_text


@pytest.mark.parametrize(
    "seeds", [range(100), pytest.param(range(100, 1300), marks=pytest.mark.slow)]
)
def test_scene_files_are_planned_or_refused_in_one_line(seeds: range) -> None:
    """Scene files around valid ones; every fourth is meshed as well if it is a scene."""
    result = Counter(fate(scene_text(Random(k)), NOWHERE, mesh=k % 4 == 0) for k in seeds)
    assert result["refused"] > 30 and result["planned"] > 10 and result["meshed"] > 1, result


@pytest.mark.parametrize("seed", [1, 2, 4, 5, 6, 7, 8, 13, 19, 21])
def test_unusual_scenes_run_or_are_refused_in_one_line(seed: int) -> None:
    assert fate(odd_scene_text(Random(seed)), NOWHERE, mesh=True, run=True) in (
        "run",
        "planned, then refused",
    )
