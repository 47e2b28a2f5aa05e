"""Waves in channels: what comes in, what is reflected, and how long waves grow on a film; a run takes 10 to 60 s."""

import numpy as np
import pytest
from numpy.polynomial import Chebyshev
from scipy.linalg import eig
from scipy.optimize import fsolve, least_squares

import incipient
from incipient.scene.file import loads

CHANNEL = """\
[domain]
kind = "channel"
length = {length}
height = 1.0
top = "free-surface"
[fluid]
reynolds = {reynolds}
scale = "flow"
[flow]
{flow}
{bed}
[gravity]
acceleration = {gravity!r}
[surface]
{wave}
sponge = {sponge}
bottom = "{bottom}"
stations = {stations}
[time]
end = {end}
step = {step}
start = "{start}"
[numerics]
mesh_size = {mesh}
error_bars = false
[output]
fields = false
"""


def amplitudes(directory, frequency, stations, last, harmonic=1):
    """Complex amplitudes (n,) at the stations of what oscillates with exp(i n w t), from the last few periods."""
    history = np.genfromtxt(directory / "history.csv", delimiter=",", names=True)
    late = history["time"] > history["time"][-1] - last * 2 * np.pi / frequency + 1e-9
    w, t = frequency, history["time"][late]
    waves = [f(n * w * t) for n in (1, 2) for f in (np.cos, np.sin)]
    columns = np.column_stack([np.ones_like(t), *waves])
    told = np.column_stack([history[f"elevation_{n}"][late] for n in range(1, len(stations) + 1)])
    found = np.linalg.lstsq(columns, told, rcond=None)[0]
    return found[2 * harmonic - 1] - 1j * found[2 * harmonic]


def two_waves(measured, stations, wave_number):
    """Amplitudes of the waves that run to the right and to the left, fitted to all stations with the wave number.

    The method of Goda & Suzuki (1976) and Mansard & Funke (1980), with more gauges than unknowns.
    """

    def fitted(k):
        columns = np.column_stack(
            [np.exp(-1j * complex(*k) * stations), np.exp(1j * k[0] * stations)]
        )
        both = np.linalg.lstsq(columns, measured, rcond=None)[0]
        return both, columns @ both - measured

    def missed(k):
        rest = fitted(k)[1]
        return np.concatenate([rest.real, rest.imag]) / np.abs(measured).max()

    k = least_squares(missed, [wave_number, 0.0]).x
    return fitted(k)[0], k[0]


def wave_run(
    directory,
    k,
    a,
    steps,
    periods,
    stations,
    stream=0.0,
    kind="uniform",
    mesh=2.0,
):
    """The history of a wave maker, with a sponge of 1.5 wave lengths; returns the frequency."""
    w = np.sqrt(k * np.tanh(k)) + k * stream
    period, length = 2 * np.pi / w, 2 * np.pi / k
    sponge = 1.5 * length
    scene = CHANNEL.format(
        length=max(stations[-1] + 0.5 + sponge, 2 * sponge),
        reynolds=1e4,
        flow=f'kind = "{kind}"\nvelocity = {stream}' if stream else 'kind = "still"',
        bed="",
        gravity=1.0,
        wave=f"wave = {{amplitude = {a}, period = {period!r}}}",
        sponge=sponge,
        bottom="slip" if kind == "uniform" else "no-slip",
        stations=stations.tolist(),
        start="steady" if stream else "rest",
        mesh=mesh,
        end=periods * period,
        step=period / steps,
    )
    incipient.run(loads(scene), directory)
    return w


@pytest.mark.slow
def test_stokes_wave_of_second_order(tmp_path):
    """k H = 2, k a = 0.1: the bound second harmonic, the free one with the speed of its own, the reflection."""
    k, a, stations = 2.0, 0.05, np.round(np.arange(1.5, 5.5, 0.2), 3)
    w = wave_run(tmp_path, k, a, 80, 12, stations)
    (onwards, back), found = two_waves(amplitudes(tmp_path, w, stations, 4), stations, k)
    assert abs(onwards) == pytest.approx(a, rel=0.01)
    assert abs(back / onwards) < 0.005
    second = amplitudes(tmp_path, w, stations, 4, harmonic=2)
    own = fsolve(lambda q: q * np.tanh(q) - 4 * w**2, 4 * w**2)[0]
    waves = [
        np.exp(-2j * found * stations),
        np.exp(-1j * own * stations),
        np.exp(1j * own * stations),
    ]
    bound, free, returned = np.linalg.lstsq(np.column_stack(waves), second, rcond=None)[0]
    exact = a**2 * k * np.cosh(k) * (2 + np.cosh(2 * k)) / (4 * np.sinh(k) ** 3)
    assert bound / onwards**2 * a**2 == pytest.approx(exact, rel=0.03)
    assert max(abs(free), abs(returned)) < 0.03 * exact


@pytest.mark.slow
@pytest.mark.parametrize(("k", "mesh"), [(1.0, 3.0), (2.0, 2.0)])
def test_a_wave_maker_and_a_sponge(tmp_path, k, mesh):
    """Amplitude and reflection in still water, and what steps make of the length.

    A second-order backward difference lowers the frequency by (w dt)^2/3, 0.8% here: the waves are shorter, by the
    ratio of their celerity to the group velocity. It is a difference of 1% between numbers measured to a thousandth.
    """
    a, stations = 0.005, np.round(np.arange(1.5, 5.5, 0.2), 3)
    w = wave_run(tmp_path, k, a, 40, 12, stations, mesh=mesh)
    (onwards, back), found = two_waves(amplitudes(tmp_path, w, stations, 4), stations, k)
    assert abs(back / onwards) < 0.005
    assert abs(onwards) == pytest.approx(a, rel=0.01)
    group = 0.5 * (1.0 + 2 * k / np.sinh(2 * k))
    assert found / k - 1.0 == pytest.approx((2 * np.pi / 40) ** 2 / 3 / group, rel=0.2)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "stream"), [("uniform", 0.2), ("uniform", 0.5), ("open-channel", 0.2)]
)
def test_a_wave_maker_in_a_stream(tmp_path, kind, stream):
    """k H = 2, on half a parabola 1.8; without elevation and velocity across the stream 0.60 came in at 0.2.

    On half a parabola a wave whose velocities know nothing of the shear has 0.96 of its height.
    """
    k, a, stations = 2.0, 0.005, np.round(np.arange(1.5, 5.5, 0.2), 3)
    w = wave_run(tmp_path, k, a, 40, 10, stations, stream, kind=kind)
    (onwards, back), _ = two_waves(amplitudes(tmp_path, w, stations, 4), stations, k)
    assert abs(onwards) == pytest.approx(a, rel=0.01)
    assert abs(back / onwards) < 0.005


def film_speeds(k, reynolds, weight, n=24):
    """Complex speeds of the waves exp(i k (x - c t)) on a film of depth and mean velocity one, by collocation.

    The Orr-Sommerfeld equation psi'''' - 2 k^2 psi'' + k^4 psi = i k Re ((U - c) (psi'' - k^2 psi) - U'' psi) with
    U = 1.5 y (2 - y); psi = psi' = 0 on the bed. On the surface, weight being g cos a and eta the elevation:
    (c - U) eta = psi, psi'' + k^2 psi + U'' eta = 0, psi''' - 3 k^2 psi' - i k Re ((U - c) psi' + weight eta) = 0
    (Yih 1963, Phys. Fluids 6, 321).
    """
    y = 0.5 * (1 - np.cos(np.pi * np.arange(n) / (n - 1)))
    columns = [Chebyshev.basis(j, domain=[0, 1]) for j in range(n)]
    P, D, D2, D3, D4 = (
        np.column_stack([c.deriv(m)(y) if m else c(y) for c in columns]) for m in range(5)
    )
    A, B = np.zeros((2, n + 1, n + 1), complex)
    strength, vorticity = 1j * k * reynolds, D2 - k**2 * P
    flow = (1.5 * y * (2 - y))[:, None]
    A[:n, :n] = D4 - 2 * k**2 * D2 + k**4 * P - strength * (flow * vorticity + 3 * P)
    B[:n, :n] = -strength * vorticity
    for row, condition in (
        (0, P[0]),
        (1, D[0]),
        (n - 1, D2[-1] + k**2 * P[-1]),
        (n - 2, D3[-1] - 3 * k**2 * D[-1]),
    ):
        A[row, :n], B[row] = condition, 0
    A[n - 1, n] = -3
    A[n - 2, :n] -= 1.5 * strength * D[-1]
    A[n - 2, n], B[n - 2, :n] = -strength * weight, -strength * D[-1]
    A[n, :n], A[n, n], B[n, n] = P[-1], 1.5, 1
    speeds = eig(A, B, right=False)
    return speeds[np.isfinite(speeds)]


def wave_on_film(frequency, reynolds, weight):
    """The complex wave number of the wave of a frequency whose speed is nearest to that of long ones, three."""

    def missed(parts):
        speeds = film_speeds(complex(*parts), reynolds, weight)
        rest = speeds[np.argmin(np.abs(speeds - 3))] * complex(*parts) - frequency
        return rest.real, rest.imag

    return complex(*fsolve(missed, [frequency / 3, 0.0]))


def test_long_waves_on_a_film_grow_from_the_critical_reynolds_number_on():
    """The reference: growth with the way (2/5) k^2 (Re - (5/6) cot a) for k to zero (Benjamin 1957, Yih 1963)."""
    for reynolds in (2.0, 6.0):
        found = -wave_on_film(0.015, reynolds, 15.0 / reynolds).imag
        assert found == pytest.approx(0.4 * 0.005**2 * (reynolds - 25 / 6), rel=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("reynolds", [8.0, 2.0])
def test_waves_on_a_film_grow_above_the_critical_reynolds_number_and_decay_below_it(
    tmp_path, reynolds
):
    """Below a pressure that oscillates a little at a place, on a slope of 0.2, where (5/6) cot a is 4.17."""
    slope, w = np.arctan(0.2), 0.6
    exact, period = wave_on_film(w, reynolds, 15.0 / reynolds), 2 * np.pi / w
    stations = np.arange(12.0, 42.0)  # nearer to the pressure other modes have not yet decayed
    scene = CHANNEL.format(
        length=60.0,
        reynolds=reynolds,
        flow='kind = "open-channel"',
        bed=f'[bed]\nkind = "inclined"\nslope = {float(np.degrees(slope))!r}',
        gravity=float(3.0 / reynolds / np.sin(slope)),
        wave=f'pressure = "0.003*exp(-(x - 5)**2)*sin({w}*t)"',
        sponge=15.0,
        bottom="no-slip",
        stations=stations.tolist(),
        start="stokes",
        mesh=5.0,
        end=6 * period,
        step=period / 40,
    )
    incipient.run(loads(scene), tmp_path)
    measured = amplitudes(tmp_path, w, stations, 2)
    assert np.polyfit(stations, np.log(np.abs(measured)), 1)[0] == pytest.approx(
        -exact.imag, rel=0.05
    )
    assert -np.polyfit(stations, np.unwrap(np.angle(measured)), 1)[0] == pytest.approx(
        exact.real, rel=0.02
    )


@pytest.mark.slow
def test_a_hump_is_washed_out_of_a_fast_stream_of_low_viscosity(tmp_path):
    """Froude number 0.6. Where nothing is asked of what enters, the elevation at the inflow passes 0.16 at t = 10."""
    scene = CHANNEL.format(
        length=6.0,
        reynolds=600.0,
        flow='kind = "uniform"\nvelocity = 0.6',
        bed="",
        gravity=1.0,
        wave="",
        sponge=0.0,
        bottom="slip",
        stations=[0.0, 1.5, 3.0, 4.5, 6.0],
        start="stokes",
        mesh=2.0,
        end=16.0,
        step=0.1,
    ).replace("stations =", 'elevation = "0.05*exp(-(x - 3)**2/0.3)"\nstations =')
    incipient.run(loads(scene), tmp_path)
    history = np.genfromtxt(tmp_path / "history.csv", delimiter=",", names=True)
    late = [history[f"elevation_{n}"][history["time"] > 8.0] for n in range(1, 6)]
    assert np.abs(late).max() < 0.3 * 0.05


@pytest.mark.slow
@pytest.mark.parametrize("friction", [True, False])
def test_a_stream_faster_than_long_waves_comes_to_the_level_of_its_inflow(tmp_path, friction):
    """Froude number 1.5, begun with a level a tenth too high: Nusselt's film, and a stream without friction."""
    slope = np.arctan(9 / 8)  # of a film Fr^2 = Re tan(a)/3
    scene = CHANNEL.format(
        length=6.0,
        reynolds=6.0 if friction else 150.0,
        flow=f'kind = "{"open-channel" if friction else "uniform"}"\nvelocity = {1.0 if friction else 1.5}',
        bed=f'[bed]\nkind = "inclined"\nslope = {np.degrees(slope)!r}' if friction else "",
        gravity=float(0.5 / np.sin(slope)) if friction else 1.0,
        wave="",
        sponge=0.0,
        bottom="no-slip" if friction else "slip",
        stations=[0.0, 1.5, 3.0, 4.5, 6.0],
        start="steady",
        mesh=3.0,
        end=20.0,
        step=0.1,
    ).replace("stations =", 'elevation = "0.1"\nstations =')
    result = incipient.run(loads(scene), tmp_path)
    assert np.abs(result.surface["elevations"]).max() < (1e-8 if friction else 1e-3)
