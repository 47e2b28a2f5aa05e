"""What a newcomer reads first about a grain that does not rest where it was put down."""

from pathlib import Path

import pytest
from mpi4py import MPI

import incipient
from incipient.scene import Scene
from incipient.thresholds.critical import find_threshold

SCENE = Path(__file__).parents[2] / "demos" / "scenes" / "grain_on_bed.toml"
TILTED = 'body={shape = "ellipse", semi_axes = [0.6, 0.4], angle = 30.0, x = 4.0, density = 2.65}'


@pytest.fixture(scope="module")
def tilted() -> Scene:
    small = [
        "domain.length=8.0",
        "domain.height=4.0",
        "numerics.mesh_size=5.0",
        "numerics.error_bars=false",
    ]
    return incipient.load(SCENE, [TILTED, *small])


def test_a_grain_that_its_weight_moves_is_told_to_settle(tilted: Scene) -> None:
    assert (
        "\n                    with body.settle = true it first rolls"
        in incipient.run(tilted).text()
    )


def test_a_threshold_of_such_a_grain_names_it_as_well(tilted: Scene) -> None:
    assert (
        "without any flow; with body.settle = true it first"
        in find_threshold(tilted, MPI.COMM_WORLD).text()
    )
