"""Effects left out: what they cost, which must be nothing, and what they would have changed."""

import json
import sys
from importlib.util import find_spec

import numpy as np
import pytest
from absent import (
    MODULES,
    OF_CHECKPOINTS,
    OF_CONTACT,
    OF_ESTIMATES,
    OF_FREE_BODY,
    OF_FREE_SURFACE,
    OF_MOVING_MESH,
    TERMS,
)
from environment import environment, finished
from scenes import ROOT

import incipient
from incipient.scene import (
    Contact,
    Disc,
    Domain,
    Effects,
    ExpressionFlow,
    Flat,
    Fluid,
    Gravity,
    Lid,
    Numerics,
    OpenChannel,
    Output,
    Poiseuille,
    Scene,
    Shear,
    Time,
)
from incipient.scene.file import dumps

COARSE = Numerics(mesh_size=3)
PLAIN = Numerics(mesh_size=3, error_bars=False)
STOKES = {
    "domain": Domain(length=6, height=3),
    "fluid": Fluid(reynolds=0.001, scale="grain"),
    "flow": Poiseuille(),
    "body": Disc(diameter=1, centre=(2, 1.2)),
    "numerics": PLAIN,
    "output": Output(fields=False),
}
GRAIN_ON_BED = {
    "domain": Domain(length=12, height=6),
    "flow": Shear(),
    "body": Disc(diameter=1, x=4, density=2.65),
    "bed": Flat(),
    "gravity": Gravity(acceleration=10),
    "contact": Contact(friction=0.5),
    "numerics": PLAIN,
}


def load_of(result):
    """As computed: what a correction changes with an effect is no part of what leaving it out changes."""
    return np.array([*result.force.computed[:2], result.torque.computed[2]])


def left_out(result, name):
    (computed,) = [one for one in result.omitted if one.name == name]
    return computed


def change(omission):
    return np.array([*omission.force[:2], omission.torque[2]])


# -- what an absent effect costs -----------------------------------------------------------------------------


@pytest.fixture
def used(tmp_path):
    """`used(taken_out=(), into=(), **changes)`: what a Stokes flow past a held disc uses, in a process of its own."""

    def run(taken_out=(), into=(), **changes):
        (tmp_path / "scene.toml").write_text(dumps(Scene(**{**STOKES, **changes})))
        order = [ROOT / "tests/absent.py", tmp_path / "scene.toml", ",".join(taken_out), *into]
        done = finished([sys.executable, *order], 900, env=environment())
        return json.loads(done.stdout.splitlines()[-1])

    return run


def test_an_absent_effect_costs_nothing(used):
    """No module of it is imported, and its terms are not there: nothing of it is executed or compiled."""
    computed = used(taken_out=TERMS)
    assert not modules_of(computed) & set(MODULES)
    assert all(find_spec(f"incipient.{name}") for name in MODULES)
    assert computed["unknowns"] == computed["effects"]["flow"] == sum(computed["effects"].values())
    assert set(computed["effects"]) == {"program", "flow", "traction", "estimates"}


def test_a_run_in_time_imports_nothing_it_does_not_need(used, tmp_path):
    """Grains held and moving, into a directory: nothing of checkpoints, contact, estimates unless it is wanted."""
    steps = {"time": Time(end=0.2, step=0.1)}
    moving = steps | {"body": Disc(diameter=1, centre=(2, 1.2), motion="free", density=1.0)}
    kept = moving | {"output": Output(fields=False, checkpoint=1)}
    held, free, saved = (
        modules_of(used(into=[tmp_path / str(k)], **changes))
        for k, changes in enumerate((steps, moving, kept))
    )
    absent = {*OF_CONTACT, *OF_ESTIMATES, *OF_CHECKPOINTS, *OF_FREE_SURFACE}
    assert not held & {*absent, *OF_MOVING_MESH, *OF_FREE_BODY}
    assert not free & absent and free >= {"coupled.moving_grain", "coupled.coupling"}
    assert saved & absent == {"restart"}


def modules_of(computed):
    """Names of modules and of the packages they are in."""
    return {name for module in computed["modules"] for name in (module, module.partition(".")[0])}


def test_the_cost_by_effect_adds_up():
    result = incipient.run(Scene(**GRAIN_ON_BED, fluid=Fluid(reynolds=20, scale="grain")))
    cost, effects = result.cost, result.cost["effects"]
    stages = sum(taken for name, taken in cost["wall_time"].items() if name != "total")
    assert sum(e["wall_time"] for e in effects.values()) == pytest.approx(stages, rel=1e-3)
    assert {"flow", "inertia", "contact", "traction"} <= set(effects)
    assert effects["inertia"]["wall_time"] > 0 and effects["inertia"]["unknowns"] == 0
    assert effects["contact"]["unknowns"] == 2
    assert "cost by effect" in result.text(details=True) and "cost by effect" not in result.text()


# -- inertia left out ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("reynolds", "flagged"), [pytest.param(0.01, False, marks=pytest.mark.slow), (0.2, True)]
)
def test_what_inertia_would_have_changed_and_that_it_is_flagged_where_it_matters(reynolds, flagged):
    scene = {**GRAIN_ON_BED, "fluid": Fluid(reynolds=reynolds, scale="grain")}
    inert = incipient.run(Scene(**scene, effects=Effects(inertia=True)))
    stokes = incipient.run(Scene(**scene | {"numerics": COARSE}, effects=Effects(inertia=False)))
    computed = left_out(stokes, "inertia")
    assert computed.exceeds is flagged
    assert ("WARNING             inertia may matter" in stokes.text()) is flagged
    estimate, true = change(computed), load_of(inert) - load_of(stokes)
    effectivity = np.linalg.norm(estimate) / np.linalg.norm(true)
    assert effectivity == pytest.approx(1.0, abs=0.05)
    # The lift, which Stokes flow has hardly any of, is of the first order.
    assert estimate[1] == pytest.approx(true[1], rel=0.02 + reynolds / 4)


def test_without_error_bars_the_estimate_is_oseen_s():
    scene = {**GRAIN_ON_BED, "fluid": Fluid(reynolds=0.004, scale="grain")}
    computed = left_out(incipient.run(Scene(**scene)), "inertia")
    assert computed.relative == pytest.approx(3 / 16 * 0.004) and "Oseen" in computed.how


def test_without_a_grain_it_is_the_velocity_that_changes():
    """A square cavity; the change of the velocity in the mean over the nodes."""
    lid = {
        "domain": Domain(kind="box", length=1, height=1),
        "fluid": Fluid(reynolds=5, scale="flow"),
        "flow": Lid(),
        "numerics": COARSE,
    }
    stokes = incipient.run(Scene(**lid, effects=Effects(inertia=False)))
    inert = incipient.run(Scene(**lid))
    before, after = (result.velocity.x.array for result in (stokes, inert))
    true = np.linalg.norm(after - before) / np.linalg.norm(before)
    assert left_out(stokes, "inertia").relative == pytest.approx(true, rel=0.01)


# -- other effects left out ----------------------------------------------------------------------------------


def test_what_the_rate_of_change_would_have_changed():
    """A tide past a cylinder, fastest in its change at the end; in Stokes flow the estimate is of first order only."""
    tide = {
        "domain": Domain(length=8, height=4, top="wall"),
        "fluid": Fluid(reynolds=0.02, scale="grain", inertia=False),
        "flow": ExpressionFlow(components=("6*y*(4 - y)/16*(1 + 0.5*sin(2*pi*t/400))", "0")),
        "body": Disc(diameter=1, centre=(3, 1.6)),
        "time": Time(end=200, step=4, start="steady"),
        "numerics": PLAIN,
    }
    unsteady = incipient.run(Scene(**tide))
    tide["numerics"] = COARSE
    quasi_steady = incipient.run(Scene(**tide, effects=Effects(unsteadiness=False)))
    assert quasi_steady.plan.scheme == "quasi-steady"
    assert quasi_steady.cost["iterations"]["factorisations"] <= 2
    computed = left_out(quasi_steady, "unsteadiness")
    assert not computed.exceeds
    assert change(computed) == pytest.approx(
        load_of(unsteady) - load_of(quasi_steady), rel=0.05, abs=1e-4
    )


def test_gravity_and_contact_left_out():
    scene = {**GRAIN_ON_BED, "fluid": Fluid(reynolds=20, scale="grain")}
    whole = incipient.run(Scene(**scene))
    weightless = incipient.run(Scene(**scene, effects=Effects(gravity=False)))
    computed = left_out(weightless, "gravity")
    assert computed.force == pytest.approx(whole.force.total - weightless.force.total)
    assert computed.exceeds and not np.any(weightless.force.weight)
    alone = incipient.run(Scene(**scene, effects=Effects(contact=False)))
    assert alone.verdict is None and "contact" not in alone.cost["effects"]
    assert load_of(alone) == pytest.approx(load_of(whole), rel=1e-10)
    assert left_out(alone, "contact").relative is None


def test_a_grain_held_in_time_that_would_have_moved():
    fast = {
        "fluid": Fluid(reynolds=20, scale="grain"),
        "time": Time(end=0.2, step=0.1, start="steady"),
    }
    result = incipient.run(Scene(**{**GRAIN_ON_BED, **fast}))
    assert result.verdict["moves"]
    assert "the grain moves from t = 0.1 on, but was held" in left_out(result, "free body").how


# -- a free surface left out ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "relative", "how"),
    [
        # A parallel flow below a lid needs the pressure 3 nu V/H^2 for each unit of length: over gravity, a slope.
        (
            {},
            pytest.approx(3.0 * 0.2 / 2.0**2 * 6.0 / 10.0 / 2.0, rel=1e-6),
            "pressure under the lid",
        ),
        # An impulse over the step is thousands of depths: that a surface matters, not by how much.
        ({"time": Time(end=1e-4, step=1e-4)}, None, "as after an impulse"),
    ],
)
def test_what_a_free_surface_would_have_changed(changes, relative, how):
    scene = Scene(
        domain=Domain(length=6.0, height=2.0),
        fluid=Fluid(reynolds=10.0, scale="flow"),
        flow=OpenChannel(),
        gravity=Gravity(acceleration=10.0),
        numerics=COARSE,
        **changes,
    )
    computed = left_out(incipient.run(scene), "free surface")
    assert computed.relative == relative and computed.exceeds and how in computed.how
