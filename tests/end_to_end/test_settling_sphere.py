"""The sphere of ten Cate et al. (2002), settling in a box: demos/settling_sphere.py, on two ranks as well."""

import re
import sys
from pathlib import Path

import pytest
from environment import environment, finished, on_ranks

DEMO = Path(__file__).parents[2] / "demos/settling_sphere.py"


def said_by_demo(directory, ranks, *settings):
    """What the demo prints."""
    command = [*(on_ranks(ranks) if ranks > 1 else []), sys.executable, DEMO, *settings]
    done = finished(command, 900, env=environment(), cwd=directory)
    assert done.returncode == 0, done.stderr
    return done.stdout


def peak(said):
    """The largest velocity over that in an endless fluid."""
    return float(re.search(r"^fastest +([\d.]+) of it", said, re.M).group(1))


def still_faster(said):
    """Whether it gains velocity up to the end."""
    when, end = re.search(r"at t = ([\d.]+) s of ([\d.]+)", said).groups()
    return float(when) >= round(float(end), 2)


@pytest.mark.slow
def test_the_start_on_two_ranks(tmp_path):
    coarse = (
        "numerics.mesh_size=3",
        "time.end=0.0225",
        "time.step=0.02",
        "time.first_step=0.5",
        "output.fields=false",
    )
    said = said_by_demo(tmp_path, 2, *coarse)
    # Abraham's drag: Re 1.49, which ten Cate et al. round to 1.5.
    assert "unbounded          38.287 mm/s" in said
    assert still_faster(said)
    # Without drag, with added mass alone, it would be (s - 1) g t / (s + 1/2); drag leaves some of it (found: 0.44).
    without_drag = 0.154639 * 9810.0 * 0.0225 / 1.654639 / 38.287
    assert 0.3 * without_drag < peak(said) < without_drag


@pytest.mark.slow
@pytest.mark.parametrize(
    ("case", "computed", "difference"), [("1", 0.894, 0.01), ("4", 0.947, 0.03)]
)
def test_the_largest_velocity(tmp_path, case, computed, difference):
    """Ten Cate et al. computed 0.894 and 0.947 (and measured 0.947 and 0.955); on such coarse cells 0.892 and 0.932.

    Finer cells give 0.905 and 0.946 (docs/validation/laminar.md): in the first case the cells' error hides that
    difference of 1.2%.
    """
    said = said_by_demo(tmp_path, 1, case, "output.fields=false", "numerics.mesh_size=2")
    assert not still_faster(said)
    assert peak(said) == pytest.approx(computed, rel=difference)
    assert re.search(rf"^computed by them +{computed} ", said, re.M)
