"""Every kind of flow in the plane and in space, in a box and in a channel: it runs to its end, or is refused."""

import json
from typing import get_args

import numpy as np
import pytest
from scenes import message

import incipient
from incipient.scene import Disc, Domain, Fluid, Numerics, Scene, Time
from incipient.scene.flows import Flow

EXTENTS = {2: {"length": 2.0, "height": 1.0}, 3: {"length": 2.0, "width": 1.0, "height": 1.0}}
COMPONENTS = {2: ["0.1*y", "0"], 3: ["0.1*z", "0", "0"]}
FLOWS = [kind.model_fields["kind"].default for kind in get_args(get_args(Flow)[0])]
THROUGH = {"shear", "poiseuille", "open-channel", "uniform", "log-law", "oscillatory"}
REFUSED = {*((kind, "box") for kind in THROUGH), ("lid", "channel")}
# What a kind needs beyond its name.
NEEDS = {"oscillatory": {"period": 2.0}}


def flow_in(kind: str, domain: str, gdim: int) -> Scene:
    """An empty domain at Re = 10 on few cells."""
    flow = {"kind": kind} | NEEDS.get(kind, {})
    if kind == "expression":
        flow["components"] = COMPONENTS[gdim]
    time = Time(end=0.5, step=0.1) if kind == "oscillatory" else None
    return Scene(
        domain=Domain(kind=domain, **EXTENTS[gdim]),
        fluid=Fluid(reynolds=10.0, scale="flow"),
        flow=flow,
        time=time,
        numerics=Numerics(mesh_size=4.0, order=2, error_bars=False),
    )


@pytest.mark.parametrize("gdim", [2, 3])
@pytest.mark.parametrize(
    ("kind", "domain"),
    [(kind, d) for kind in FLOWS for d in ("box", "channel") if (kind, d) not in REFUSED],
)
def test_a_flow_runs_to_its_end_and_its_fields_are_whole(kind, domain, gdim, tmp_path):
    result = incipient.run(flow_in(kind, domain, gdim), tmp_path)
    stored = json.loads((tmp_path / "result.json").read_text())
    assert stored["status"] == "complete"
    assert {"fields", "fields.xdmf"} <= {file.name for file in tmp_path.iterdir()}
    assert (stored["centrelines"] is None) == (kind != "lid")
    speeds = np.abs(result.velocity.x.array).max()
    assert np.isfinite(speeds)
    assert (speeds > 0.0) == (kind != "still")


def test_a_flow_that_reverses_enters_through_its_open_end(tmp_path):
    """A disc in a uniform flow to and fro at Re 200, its wake carried back over it.

    Returning fluid with its own momentum gained energy without limit: the force reached 1e14 at t = 3.6.
    Morison's force is at most 3: inertia 1.97 (C_m = 2) and drag 1 (C_d = 2), were they in phase.
    """
    reversing = Scene(
        domain=Domain(length=8.0, height=6.0),
        fluid=Fluid(reynolds=200.0, scale="grain"),
        flow={"kind": "expression", "components": ["cos(2*pi*t/5)", "0"]},
        body=Disc(diameter=1.0, centre=(4.0, 3.0)),
        time={"end": 5.0, "step": 0.1, "start": "steady"},
        numerics=Numerics(mesh_size=2.0, order=2, error_bars=False),
    )
    incipient.run(reversing, tmp_path)
    history = np.genfromtxt(tmp_path / "history.csv", delimiter=",", names=True)
    assert history["step"] == pytest.approx(0.1)
    assert np.abs(history["force_x"]).max() < 3.0
    assert history["force_x"].min() < -1.0  # the flow pushes upstream while it runs there


@pytest.mark.parametrize("gdim", [2, 3])
@pytest.mark.parametrize(("kind", "domain"), sorted(REFUSED))
def test_a_flow_that_a_domain_cannot_have_is_refused(kind, domain, gdim):
    assert message(lambda: flow_in(kind, domain, gdim)).startswith("Scene: flow.kind: ")
