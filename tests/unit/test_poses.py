"""Random orientations of a grain, and what a survey of poses refuses."""

from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI
from scenes import sphere_on_plane

from incipient.errors import SceneError
from incipient.scene import Ellipsoid, Scene
from incipient.scene.file import dumps, example, loads
from incipient.survey.orientations import Poses, _settings, random_orientation, survey_poses
from incipient.sweep.cases import identity_of


def test_all_rotations_are_equally_likely() -> None:
    """Turned axes are uniform on the sphere: heights uniform from -1 to 1 (Archimedes), for each axis."""
    random = np.random.default_rng(1)
    turned = []
    for _ in range(2000):
        body = Ellipsoid(semi_axes=(1.0, 0.8, 0.6), x=1.0, orientation=random_orientation(random))
        turned.append(body.placed((0.0, 0.0, 0.0)).rotation)
    heights = np.sort(np.array(turned)[:, 2], axis=0)
    exact = np.linspace(-1.0, 1.0, 2000)
    # Kolmogorov's distance of 2000 samples is below 0.0364 with a probability of 99%; heights span 2.
    assert np.abs(heights - exact[:, None]).max() < 2.0 * 0.0364


def test_the_first_pose_is_the_scenes_own() -> None:
    found = _settings(Poses(3, 2), (10.0, 20.0, 30.0))
    assert len(found) == 6 and len(set(found)) == 6
    assert found[0] == ("body.orientation=[10, 20, 30]", "bed.seed=0")
    assert _settings(Poses(3, 1), (0.0, 0.0, 0.0))[0] == ("body.orientation=[0, 0, 0]",)
    assert found[:3] != found[3:] and [one[0] for one in found[:3]] == [one[0] for one in found[3:]]


def test_what_is_refused(tmp_path: Path) -> None:
    in_plane, ordered = tmp_path / "plane.toml", tmp_path / "ordered.toml"
    in_plane.write_text(example())
    ordered.write_text(dumps(loads(example(in_space=True))))
    for path, said in (
        (in_plane, "need a 3-D grain that rests on a bed; give body.x"),
        (ordered, "--seeds: "),
    ):
        with pytest.raises(SceneError) as caught:
            survey_poses(path, (), Poses(2, 2), tmp_path / "out", MPI.COMM_WORLD)
        assert said in str(caught.value) and "\n" not in str(caught.value)


def test_poses_of_an_earlier_call_in_the_same_place_are_not_counted(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Four poses, whose Shields numbers are 0.01 to 0.04, then the first two of them alone."""
    boxes = tmp_path / "box.toml"
    body = Ellipsoid(semi_axes=(0.6, 0.5, 0.4), x=5.0, density=2.65, settle=True)
    boxes.write_text(dumps(sphere_on_plane(body=body)))
    computed: dict[str, dict[str, object]] = {}

    def sweep(scenes: list[Scene], *_: object, **__: object) -> None:
        for scene in scenes:
            number = len(computed)
            row = {"id": identity_of(scene, "threshold"), "source": scene.title, "status": "done"}
            row |= {"mode": "rolling", "shields_nominal": 0.01 * (number + 1)}
            computed.setdefault(str(row["id"]), row)

    monkeypatch.setattr("incipient.survey.orientations.run_sweep", sweep)
    monkeypatch.setattr("incipient.survey.orientations.rows", lambda file: list(computed.values()))
    four, two = (
        survey_poses(boxes, (), Poses(count), tmp_path / "out", MPI.COMM_WORLD) for count in (4, 2)
    )
    assert four.shields == pytest.approx((0.01, 0.02, 0.03, 0.04))
    assert (two.poses, two.shields) == (2, pytest.approx((0.01, 0.02)))
    assert "50% below 0.02" in four.text()
    assert "0.01, 0.02: too few for percentiles" in two.text() and "below" not in two.text()
