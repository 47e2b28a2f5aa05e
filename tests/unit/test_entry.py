"""What enters a channel below a free surface: the discharge asked for, whatever the depth."""

import numpy as np
import pytest
from domains import curved_box

from incipient import compat
from incipient.fluid.conditions import Entering
from incipient.fluid.constraints import Entry
from incipient.fluid.space import taylor_hood


@pytest.fixture
def entry():
    """An end of the unit square with a parabola that changes in time, above a bottom at which the fluid sticks."""
    domain = curved_box(2, 3, 2)

    def velocity(x, t):
        return (1.0 + t) * x[1] * (2.0 - x[1])

    return domain, Entry(
        domain, taylor_hood(domain.mesh, 2), Entering("left", 0, velocity, 0.4), ("bottom",)
    )


@pytest.mark.parametrize("rise", [0.0, 0.25, -0.5])
def test_the_discharge_is_that_through_the_end_as_it_was_made(entry, rise):
    domain, made = entry
    domain.mesh.geometry.x[:, 1] *= 1.0 + rise
    made.update(0.5)
    assert made.influx == pytest.approx(1.5 * 2.0 / 3.0, rel=1e-14)
    on = compat.nodes_on(made.space, domain.facets_of("left"))
    height = made.space.tabulate_dof_coordinates()[on, 1] / (1.0 + rise)
    assert made.values.x.array[on] == pytest.approx(
        1.5 / (1.0 + rise) * height * (2.0 - height), abs=1e-14
    )


def test_a_profile_whose_discharge_vanishes_is_stretched_likewise(entry):
    domain, made = entry
    made._velocity = lambda x, t: np.cos(np.pi * x[1])
    made.update(0.0)
    whole = made.influx
    domain.mesh.geometry.x[:, 1] *= 1.25
    made.update(0.0)
    assert made.influx == pytest.approx(whole, rel=1e-13)
    assert np.abs(made.values.x.array).max() == pytest.approx(1.0 / 1.25)
