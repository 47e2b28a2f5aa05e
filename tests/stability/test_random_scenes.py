"""Scene files at random: each is planned, meshed or run, or refused in one line; none hangs, none gives no number."""

from collections import Counter
from random import Random

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from random_scenes import NOWHERE, fate, odd_scene_text, scene_text

USUAL = settings(
    derandomize=True, deadline=None, database=None, suppress_health_check=list(HealthCheck)
)


def test_scene_files_are_planned_or_refused_in_one_line() -> None:
    """Scene files around valid ones; every fourth is meshed as well if it is a scene."""
    found = Counter(
        fate(scene_text(Random(seed)), NOWHERE, mesh=seed % 4 == 0) for seed in range(100)
    )
    assert found["refused"] > 30 and found["planned"] > 10 and found["meshed"] > 1, found


@pytest.mark.slow
@pytest.mark.parametrize("number", [300, 900])
def test_any_scene_file_is_planned_or_refused_in_one_line(number: int) -> None:
    """Many more, chosen and, where they fail, made smaller by hypothesis, which takes longer than to plan them."""
    found: Counter[str] = Counter()

    @settings(USUAL, max_examples=number)
    @given(st.randoms(use_true_random=False), st.integers(0, 9))
    def tried(random: Random, turn: int) -> None:
        found[fate(scene_text(random), NOWHERE, mesh=turn == 0)] += 1

    tried()
    assert found["refused"] > 30 and found["planned"] > 30 and found["meshed"] > 3, found


@pytest.mark.parametrize("seed", [1, 2, 4, 5, 6, 7, 8, 13, 19, 21])
def test_unusual_scenes_run_or_are_refused_in_one_line(seed: int) -> None:
    assert fate(odd_scene_text(Random(seed)), NOWHERE, mesh=True, run=True) in (
        "run",
        "planned, then refused",
    )


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("x = " + "9" * 5000, "has an integer with thousands of digits; shorten it"),
        ("x" * 5000 + " = 1", "unknown key; known are"),
        ('[domain]\nlength = 1\nheight = 1\nkind = "' + "k" * 5000 + '"', "is not known; use"),
    ],
)
def test_what_is_very_long_is_cut_in_the_message(text: str, why: str) -> None:
    from incipient.errors import SceneError
    from incipient.scene import loads

    with pytest.raises(SceneError, match=why) as told:
        loads(text)
    assert len(str(told.value)) < 500
