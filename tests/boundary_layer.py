"""The k-omega SST model along a flat plate by the equations of the boundary layer, in k and omega themselves.

Written for tests and benchmarks from the equations as they are printed (Menter, Kuntz & Langtry 2003): nothing of the
program is used. Finite volumes across the layer, steps along the plate, each implicit in both.
"""

import numpy as np
from scipy.linalg import solve_banded

BETA_STAR, A_1 = 0.09, 0.31
INNER, OUTER = (0.85, 0.5, 0.075, 5.0 / 9.0), (1.0, 0.856, 0.0828, 0.44)
RELAXED, MOST_ROUNDS, SAME = 0.7, 60, 1e-9


def friction(viscosity, length, k, omega, first=5e-7, ratio=1.03, height=0.1, step=0.02):
    """C_f (n,) at x (n,) of a stream of speed one with this k and omega; volumes grow from `first` by `ratio`."""
    number = int(np.log(1.0 + height * (ratio - 1.0) / first) / np.log(ratio))
    faces = np.concatenate(
        [[0.0], first * (ratio ** np.arange(1, number + 1) - 1.0) / (ratio - 1.0)]
    )
    y, sizes = 0.5 * (faces[1:] + faces[:-1]), np.diff(faces)
    speed, k, omega = np.ones(number), np.full(number, k), np.full(number, omega)
    across, near, x, found = np.zeros(number), y < 3.0 * first, 0.0, []
    while x < length:
        along = min(max(1e-5, step * x), length - x + 1e-15)
        before = speed.copy(), k.copy(), omega.copy()
        for _ in range(MOST_ROUNDS):
            strain, terms = _terms(y, speed, k, omega, viscosity)
            eddies, inner, cross = terms
            sigma_k, sigma_omega, beta, gamma = (
                inner * a + (1.0 - inner) * b for a, b in zip(INNER, OUTER, strict=True)
            )
            rows = [
                _rows(y, sizes, viscosity + _at_faces(one * eddies), speed / along, across)
                for one in (1.0, sigma_k, sigma_omega)
            ]
            made = np.minimum(eddies * strain**2, 10.0 * BETA_STAR * k * omega)
            new_speed = _solved(rows[0], speed / along * before[0], 0.0)
            new_speed[-1] = 1.0
            new_k = _solved(rows[1], speed / along * before[1] + made, BETA_STAR * omega)
            pull = (1.0 - inner) * cross
            right = speed / along * before[2] + gamma * strain**2 + np.maximum(pull, 0.0)
            left = beta * omega + np.maximum(-pull, 0.0) / omega
            new_omega = _solved(rows[2], right, left, (near, 6.0 * viscosity / (0.075 * y**2)))
            change = np.abs(new_speed - speed).max()
            speed = speed + RELAXED * (new_speed - speed)
            k = np.maximum(k + RELAXED * (new_k - k), 1e-16)
            omega = np.maximum(omega + RELAXED * (new_omega - omega), 1e-8)
            through = np.concatenate([[0.0], np.cumsum((before[0] - speed) / along * sizes)])
            across = 0.5 * (through[1:] + through[:-1])
            if change < SAME:
                break
        x += along
        found.append((x, 2.0 * viscosity * speed[0] / y[0]))
    return np.array(found).T


def _terms(y, speed, k, omega, viscosity):
    """The strain, and eddy viscosity, F_1 and cross diffusion."""
    strain = np.empty_like(y)
    strain[1:-1] = (speed[2:] - speed[:-2]) / (y[2:] - y[:-2])
    strain[0], strain[-1] = speed[0] / y[0], 0.0
    strain = np.maximum(np.abs(strain), 1e-12)
    cross = 2.0 * OUTER[1] / omega * np.gradient(k, y) * np.gradient(omega, y)
    turbulent, viscous = np.sqrt(k) / (BETA_STAR * omega * y), 500.0 * viscosity / (y**2 * omega)
    bound = 4.0 * OUTER[1] * k / (np.maximum(cross, 1e-10) * y**2)
    inner = np.tanh(np.minimum(np.minimum(np.maximum(turbulent, viscous), bound), 5.0) ** 4)
    limited = np.tanh(np.minimum(np.maximum(2.0 * turbulent, viscous), 5.0) ** 2)
    return strain, (A_1 * k / np.maximum(A_1 * omega, strain * limited), inner, cross)


def _at_faces(values):
    return np.concatenate([[0.0], 0.5 * (values[1:] + values[:-1]), [0.0]])


def _rows(y, sizes, diffusivity, rate, across):
    """Entries below, on and above the diagonal of convection and diffusion; zero on the wall."""
    apart = np.diff(y)
    below, on, above = np.zeros_like(y), rate.copy(), np.zeros_like(y)
    flux = diffusivity[1:-1] / apart
    below[1:] -= flux / sizes[1:] + np.maximum(across[1:], 0.0) / apart
    above[:-1] -= flux / sizes[:-1] - np.minimum(across[:-1], 0.0) / apart
    on -= below + above
    on[0] += diffusivity[0] / y[0] / sizes[0]
    return below, on, above


def _solved(rows, right, lost, given=None):
    below, on, above = (one.copy() for one in rows)
    on += lost
    right = right.copy()
    if given is not None:
        where, values = given
        below[where], on[where], above[where], right[where] = 0.0, 1.0, 0.0, values[where]
    banded = np.zeros((3, len(on)))
    banded[0, 1:], banded[1], banded[2, :-1] = above[:-1], on, below[1:]
    return solve_banded((1, 1), banded, right)
