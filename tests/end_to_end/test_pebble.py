"""The scanned pebble of demos/pebble.py: its scans, the verdict on given loads on them, and the demo itself."""

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest
from environment import environment, finished, on_ranks

import incipient
from incipient.contact import Load
from incipient.contact.verdict import judge
from incipient.evaluation.contact_verdict import find_contacts
from incipient.geometry.space.grains import Triangulated

DEMOS = Path(__file__).parents[2] / "demos"
SCENE = DEMOS / "scenes/pebble.toml"


@pytest.fixture(scope="module")
def scan():
    """What writes a scan of the pebble."""
    spec = importlib.util.spec_from_file_location(
        "scanned_pebble", DEMOS / "scenes/scanned_pebble.py"
    )
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.scan


def test_the_pebble_in_the_repository_is_what_the_script_writes(scan, tmp_path):
    scan(tmp_path / "pebble.stl", 1280)
    made, kept = (
        Triangulated.from_file(place / "pebble.stl") for place in (tmp_path, SCENE.parent)
    )
    assert len(kept.triangles) == 1280
    assert made.vertices == pytest.approx(kept.vertices, abs=1e-6)  # files are of single precision


def test_scans_converge_with_their_facets(scan, tmp_path):
    """Corners on a smooth surface: volume and moments err in the second order of the facets' size, so 4 to 1."""
    found = []
    for facets in (320, 1280, 5120):
        scan(tmp_path / "pebble.stl", facets)
        pebble = Triangulated.from_file(tmp_path / "pebble.stl")
        found.append([pebble.volume, *np.linalg.eigvalsh(pebble.inertia)])
    coarse, middle, fine = np.array(found)
    # The next term of the error is of fourth order in the facets' size.
    assert (middle - coarse) / (fine - middle) == pytest.approx(4.0, rel=0.15)


@pytest.mark.slow
def test_a_given_load_on_several_scans(scan, tmp_path):
    """What is judged is the pebble: facets elsewhere on it, or four times as many, change little.

    Contacts lie on facets, whose normals are off by up to half a facet's width over the radius of curvature, 0.17 rad
    of 320 facets. If all did so at once, what holds the grain would change by tan(45 degrees + 0.17 rad) = 1.41.
    """
    found = []
    for turn, facets in ((0, 320), (1, 320), (0, 1280)):
        scene = incipient.load(SCENE, [scan(tmp_path / "pebble.stl", facets, turn)])
        weight = (scene.body.density - 1.0) * scene.grain.volume * scene.gravity.acceleration
        load = Load(
            0.5 * weight * np.eye(3)[0],
            np.zeros(3),
            -weight * np.eye(3)[2],
            np.array(scene.placement.centre),
        )
        verdict = judge(load, find_contacts(scene), scene.contact.friction).to_dict()
        found.append(verdict["safety_factor"])
        assert len(find_contacts(scene).points) == 3
    assert min(found) > 0.0 and max(found) < 1.41 * min(found), found
    assert len(set(found)) == 3


@pytest.mark.slow
def test_the_demo_on_two_ranks(tmp_path):
    """With coarse cells and no error bars; whether its scans agree is what it says, not what is checked."""
    settings = ["--set", "numerics.error_bars=false", "--set", "numerics.mesh_size=8"]
    command = [*on_ranks(2), sys.executable, DEMOS / "pebble.py", "320", "1280", *settings]
    done = finished(command, 600, env=environment(), cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    first, second, last = (
        line for line in done.stdout.splitlines() if "facets: " in line or "agree" in line
    )
    assert first.startswith("320 facets: ") and second.startswith("1280 facets: ")
    assert last == "all agree" or last.startswith("they do not agree, by ")
