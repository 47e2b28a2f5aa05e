"""The drag between walls that other tests compare with, by Faxén's series and by multipoles."""

import numpy as np
import pytest
from between_walls import drag, faxen_drag


@pytest.mark.parametrize(
    ("k", "cut_off"), [(0.05, 1e-5), (0.125, 1e-5), (0.25, 4e-5), (1 / 3, 5e-4)]
)
def test_faxen_s_series_for_narrow_cylinders(k, cut_off):
    """Its numbers have four digits, and the term after the last is about 10 k^10."""
    assert faxen_drag(k) == pytest.approx(drag(k), rel=cut_off)


def test_faxen_s_numbers():
    """Those of a polynomial through drags by multipoles, as good as it tells them apart."""
    k = np.linspace(0.04, 0.3, 40)
    powers = k[:, None] ** (2 * np.arange(8))
    beyond_logarithm = [4 * np.pi / drag(one) + np.log(one) for one in k]
    found = np.linalg.lstsq(powers, np.array(beyond_logarithm), rcond=None)[0]
    assert found[:3] == pytest.approx([-0.9157, 1.7244, -1.7302], abs=1e-4)
    assert found[3:5] == pytest.approx([2.4056, -4.5913], rel=1e-2)
