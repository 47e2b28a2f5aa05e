"""A stream that starts within the first step."""

import pytest
from scenes import IN_STREAM, history_of

import incipient
from incipient.scene.file import loads


@pytest.mark.parametrize("scheme", ["bdf1", "bdf2"])
def test_the_impulse_acts_in_the_first_step_alone(tmp_path, scheme):
    """Halved steps double it; afterwards the stream pushes the disc ahead, ever less."""
    pushed = []
    for step in (0.1, 0.05):
        time = f'[time]\nend = 0.4\nstep = {step}\nscheme = "{scheme}"\n'
        few = "[numerics]\nmesh_size = 3.0\nerror_bars = false\n[output]\nfields = false\n"
        incipient.run(loads(IN_STREAM + time + few), tmp_path / str(step))
        pushed.append(history_of(tmp_path / str(step))["force_x"])
    assert pushed[1][0] == pytest.approx(2.0 * pushed[0][0], rel=0.2)
    for later in (force[1:] for force in pushed):
        assert later[-1] > 0.0
        assert (later[:-1] > later[1:]).all()
