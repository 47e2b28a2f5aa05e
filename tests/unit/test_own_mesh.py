"""A turbulent threshold is found on a mesh made for the law of the wall of the critical flow itself."""

from contextlib import nullcontext
from types import SimpleNamespace

import numpy as np
import pytest
from mpi4py import MPI
from turbulent import channel, grain

from incipient.contact import Load
from incipient.errors import ConvergenceError
from incipient.planning.flow_setup import Setup
from incipient.progress import Silent
from incipient.scene import Disc, Flat, Fluid, Turbulence
from incipient.threshold import meshes
from incipient.threshold.search import CriticalFlow, SolvedFlow


class Pretended:
    """Searches on meshes whose critical flow is a function of what they are made for, S going as its square."""

    def __init__(self, monkeypatch, critical):
        self.made_for, self.critical, self.trials = [], critical, []
        monkeypatch.setattr(meshes, "prepared", self._prepared)
        monkeypatch.setattr(meshes, "CriticalSearch", lambda run: self)

    def _prepared(self, scene, comm, accounts, voice, speed):
        self.made_for.append(speed)
        return nullcontext(SimpleNamespace())

    def from_rest(self):
        factor = self.critical(self.made_for[-1])
        path = SimpleNamespace(load=lambda at: load(1.0))
        return CriticalFlow(factor, factor, path, (SolvedFlow(12.0, 2.0),), reason="held")

    def near(self, before):
        assert before.factor == self.critical(self.made_for[-2])
        return self.from_rest()

    def load_at(self, factor):
        strength = (factor / self.critical(self.made_for[-1])) ** 2
        self.trials.append(SolvedFlow(factor, 1.0 / strength))
        return load(strength)

    def threshold(self, scene):
        return meshes.on_its_own_mesh(
            scene, MPI.COMM_SELF, Silent(), lambda run, search, found: found
        )


def load(strength):
    return Load(
        strength * np.array([1.0, 0.5, 0.0]),
        strength * np.array([0.0, 0.0, 0.2]),
        np.zeros(3),
        np.zeros(3),
    )


def test_the_mesh_is_made_anew_until_the_law_of_the_wall_is_its_own(monkeypatch):
    """On the second mesh the critical flow is 12% faster, as of a sphere between ridges; what is left is an error."""
    pretended = Pretended(monkeypatch, lambda speed: 1.24 + 0.34 * speed)
    found = pretended.threshold(grain(0.2))
    on_third = 1.24 + 0.34 * 1.7772
    assert pretended.made_for == pytest.approx([1.0, 1.58, 1.7772, on_third])
    assert found.factor == pytest.approx(on_third) and len(found.trials) == 3
    strength = (on_third / (1.24 + 0.34 * on_third)) ** 2
    assert found.own_mesh.safety_factor == pytest.approx(1.0 / strength)
    assert found.own_mesh.change == pytest.approx(
        (1.0 - strength) * np.array([1.0, 0.5, 0.0, 0.0, 0.0, 0.2])
    )


def test_one_mesh_does_where_the_law_of_the_wall_hardly_changes(monkeypatch):
    """The second one is that of the critical flow itself."""
    pretended = Pretended(monkeypatch, lambda speed: 1.02)
    found = pretended.threshold(grain(0.2))
    assert found.factor == 1.02 and pretended.made_for == [1.0, 1.02]
    assert found.own_mesh.safety_factor == 1.0 and not found.own_mesh.change.any()


def test_a_threshold_that_no_mesh_agrees_on_is_refused(monkeypatch):
    pretended = Pretended(monkeypatch, lambda speed: 2.0 / speed)
    with pytest.raises(
        ConvergenceError, match=r"differs from mesh to mesh.*: it is 2, 1, 2, .* smaller"
    ):
        pretended.threshold(grain(0.2))
    assert len(pretended.made_for) == meshes.MOST_MESHES


def test_what_faster_flows_hold_on_the_mesh_of_a_slower_one_is_said(monkeypatch):
    pretended = Pretended(monkeypatch, lambda speed: float("inf"))
    found = pretended.threshold(grain(0.2))
    assert pretended.made_for == [1.0]
    assert found.reason == f"held; {meshes.OTHER_MESH}"


def test_a_mesh_serves_as_long_as_the_distance_of_the_law_does():
    """It is 50 nu/u* and goes nearly as the inverse of the flow, unless it or the sand is given."""
    smooth = grain(0.2)
    ratio = Setup(smooth).walls.distance / Setup(smooth).faster(1.5).walls.distance
    assert 1.4 < ratio < 1.5
    assert meshes.outgrown(Setup(smooth), 1.0, 1.5) and meshes.outgrown(Setup(smooth), 1.5, 1.0)
    assert not meshes.outgrown(Setup(smooth), 1.5, 1.52)
    for asked in (Turbulence(wall_distance=0.006), Turbulence(wall="rough", roughness=0.01)):
        given = channel(
            fluid=Fluid(reynolds=2e5, scale="flow"),
            body=Disc(diameter=0.2, x=4),
            bed=Flat(),
            turbulence=asked,
        )
        assert not meshes.outgrown(Setup(given), 1.0, 3.0)
