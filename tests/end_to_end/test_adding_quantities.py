"""An output quantity added as docs/contribute/adding.md says: one entry, which history, result, text and table have.

The quantity is the flux of volume along the channel, the integral of v . grad x over the fluid. By the divergence
theorem that is the discharge times the length, whatever stands in the channel: V H L with the mean velocity V.
"""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import pytest
import ufl
from dolfinx import fem

import incipient
from incipient import compat
from incipient.effects.flow import FlowEffect, UnsteadinessEffect
from incipient.planning.flow_setup import Setup
from incipient.reporting import part
from incipient.reporting.page import Bounded, cell
from incipient.results.quantity import OutputQuantity
from incipient.scene import Disc, Domain, Fluid, Numerics, Output, Poiseuille, Scene, Time
from incipient.sweep.worker import quantities

LENGTH, HEIGHT, SHARE = 6.0, 3.0, 0.01
SCENE = Scene(
    domain=Domain(length=LENGTH, height=HEIGHT),
    fluid=Fluid(reynolds=1.0, scale="grain"),
    flow=Poiseuille(),
    body=Disc(diameter=1, centre=(2, 1.2)),
    time=Time(end=0.2, step=0.1, start="stokes"),
    numerics=Numerics(mesh_size=3, error_bars=False),
    output=Output(fields=False),
)


def _flux(run: Any) -> float:
    velocity, comm = run.fluid.velocity, run.comm
    return float(comm.allreduce(fem.assemble_scalar(compat.form(velocity[0] * ufl.dx))))


def _within_a_share(stored: Any) -> tuple[float, float]:
    return (1.0 - SHARE) * stored["flux"], (1.0 + SHARE) * stored["flux"]


FLUX = OutputQuantity(
    "flux",
    "flux of volume",
    unit="velocity area length",
    column="flux",
    ends=_within_a_share,
    heading="other numbers",
    measure=_flux,
    at_steps=True,
    line="flux of volume",
)


@pytest.fixture
def added(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(FlowEffect, "quantities", (*FlowEffect.quantities, FLUX))


@pytest.mark.usefixtures("added")
def test_a_quantity_in_the_list_is_in_all_that_a_run_leaves(tmp_path: Path) -> None:
    result = incipient.run(SCENE, tmp_path)
    flux = Setup(SCENE).base_flow.mean_speed * HEIGHT * LENGTH
    stored = json.loads((tmp_path / "result.json").read_text())
    assert stored["flux"] == pytest.approx(
        flux, rel=1e-3
    )  # by the velocities at the nodes of the inflow
    with (tmp_path / "history.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) > 1 and float(rows[-1]["flux"]) == stored["flux"]
    assert f"flux of volume [velocity area length] {stored['flux']:.6g}" in result.text()
    assert "pressure part" in result.text(details=True) and "pressure part" not in result.text()
    row = quantities("run", stored)
    ends = pytest.approx((0.99 * flux, 1.01 * flux), rel=1e-3)
    assert row["flux"] == stored["flux"] and (row["flux_low"], row["flux_high"]) == ends
    page, _ = part(tmp_path / "result.json")
    shown = cell(Bounded(row["flux"], row["flux_low"], row["flux_high"]))
    assert f'<tr><th scope="row">{FLUX.label}</th><td class="number">{shown}</td></tr>' in page


def test_of_an_absent_effect_it_is_null_and_not_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(UnsteadinessEffect, "quantities", (FLUX,))
    steady = incipient.run(SCENE.model_copy(update={"time": None}))
    assert steady.to_dict()["flux"] is None
    assert FLUX.words not in steady.text()


def test_without_the_entry_there_is_none() -> None:
    assert "flux" not in quantities("run", {"verdict": None, "flux": 1.0})
