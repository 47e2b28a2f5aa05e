"""The coefficients of Runge-Kutta-Fehlberg 4(5) and of its continuous extension.

Sources: E. Fehlberg, NASA TR R-315 (1969), formula 2 (the pair); Enright, Jackson, Norsett & Thomsen, ACM
TOMS 12 (1986) (extension by bootstrapping: each polynomial gives the arguments of slopes for a better one).
"""

import numpy as np

from incipient.arrays import Floats

NODES = np.array([0.0, 1 / 4, 3 / 8, 12 / 13, 1.0, 1 / 2])
STAGES = np.array(
    [
        [0.0, 0.0, 0.0, 0.0, 0.0],
        [1 / 4, 0.0, 0.0, 0.0, 0.0],
        [3 / 32, 9 / 32, 0.0, 0.0, 0.0],
        [1932 / 2197, -7200 / 2197, 7296 / 2197, 0.0, 0.0],
        [439 / 216, -8.0, 3680 / 513, -845 / 4104, 0.0],
        [-8 / 27, 2.0, -3544 / 2565, 1859 / 4104, -11 / 40],
    ]
)
WEIGHTS = {
    4: np.array([25 / 216, 0.0, 1408 / 2565, 2197 / 4104, -1 / 5, 0.0]),
    5: np.array([16 / 135, 0.0, 6656 / 12825, 28561 / 56430, -9 / 50, 2 / 55]),
}


def _extension(places: tuple[float, ...]) -> Floats:
    """The matrix that makes powers c_k of y(t + s h) = y + h sum c_k s^k from slopes.

    The slopes: at the start, the mean one, at the end, and at `places` (s) within.
    """
    powers = np.arange(1, 4 + len(places))
    rows = [np.where(powers == 1, 1.0, 0.0), np.ones(len(powers)), powers.astype(float)]
    rows += [powers * s ** (powers - 1.0) for s in places]
    return np.asarray(np.linalg.inv(np.array(rows)))


# A quartic with one more slope, from the cubic; then a quintic with two from the quartic. (Not the middle, nor
# places symmetric about it: there the conditions are dependent.)
WITHIN = (0.2, 0.4)
CUBIC, QUARTIC, QUINTIC = (_extension(WITHIN[:count]) for count in range(3))
