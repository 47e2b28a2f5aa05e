"""Placements in space and in the plane: turns there and back, one after the other."""

import numpy as np
import pytest
from every_shape import vectors
from hypothesis import given, settings

from incipient.errors import SceneError
from incipient.geometry import Placement
from incipient.geometry.placement import product, rotation_by


class TestPlacementInSpace:
    @settings(max_examples=30, deadline=None)
    @given(vectors, vectors, vectors)
    def test_turns_are_rotations_and_go_there_and_back(self, turn, shift, point):
        placement = Placement((0.1, 0.2, 0.3)).moved(shift, turn)
        rotation = placement.rotation
        assert rotation @ rotation.T == pytest.approx(np.eye(3), abs=1e-14)
        assert np.linalg.det(rotation) == pytest.approx(1.0)
        x = np.array([point])
        assert placement.to_body(placement.to_scene(x)) == pytest.approx(x, abs=1e-13)
        # A rotation leaves its own axis in place.
        assert rotation @ np.array(turn) == pytest.approx(np.array(turn), abs=1e-12)

    def test_a_quarter_turn_about_the_vertical(self):
        placement = Placement((0.0, 0.0, 1.0)).moved((0, 0, 0), (0.0, 0.0, np.pi / 2))
        assert placement.to_scene([[1.0, 0.0, 0.0]]) == pytest.approx(np.array([[0.0, 1.0, 1.0]]))
        assert placement.raised(0.5).centre == (0.0, 0.0, 1.5)
        assert placement.raised(0.5).quaternion == placement.quaternion

    def test_turns_are_made_one_after_the_other(self):
        first, second = rotation_by((0.3, 0.0, 0.1)), rotation_by((0.0, -0.7, 0.2))
        both = Placement((0, 0, 0), quaternion=product(second, first)).rotation
        parts = [Placement((0, 0, 0), quaternion=q).rotation for q in (second, first)]
        assert both == pytest.approx(parts[0] @ parts[1])

    def test_in_the_plane_nothing_changes(self):
        placement = Placement((1.0, 2.0), 0.4)
        assert (placement.quaternion, placement.gdim) == (None, 2)
        assert placement.moved((0.5, 0.0), [0.1]) == Placement((1.5, 2.0), 0.5)

    @pytest.mark.parametrize(
        ("make", "reason"),
        [
            (lambda: Placement((0, 0, 0), 0.3), "no angle"),
            (lambda: Placement((0, 0), 0.0, (1, 0, 0, 0)), "no quaternion"),
            (lambda: Placement((0, 0, 0), quaternion=(1, 1, 0, 0)), "unit length"),
            (lambda: Placement((0, 0, 0), quaternion=(np.nan, 0, 0, 0)), "unit length"),
            (lambda: Placement((0, 0, np.inf)), "finite"),
        ],
    )
    def test_bad_placements_are_refused(self, make, reason):
        with pytest.raises(SceneError, match=reason):
            make()
