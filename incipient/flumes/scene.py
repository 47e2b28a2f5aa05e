"""The scene that computes one grain of a bed in a flume, with every number explained."""

from __future__ import annotations

from ..scene import loads
from ..setup.setup import Setup
from .answer import FlumeAnswer

SHALLOWEST, DEEPEST = 5.0, 30.0  # depths that are computed [d]
RESOLVED = 30.0  # u* d/nu from which the flow past the grain is turbulent

HEAD = """\
# One grain in the pocket of three others of its size, in the flow of a flume: u* d/nu = {reynolds:.3g}.
# Lengths are in grain diameters.

[domain]
length = 9.0                # four diameters upstream of the grain, five downstream
width = 5.0                 # half of it is computed; makes the scene three-dimensional
height = {height:.4g}              # {depth}

[fluid]
scale = "grain"             # Reynolds number, gravity and density follow from [units]

{flow}
[bed]                       # a triangular pattern of equal spheres
kind = "spheres"
radius = 0.5
spacing = 1.0               # they touch
arrangement = "triangular"
offset = [4.2887, 3.0]      # puts the pocket of three spheres at x = 4, y = 2.5
angle = 90.0                # turns the pattern, so that the grain leaves between two spheres

[body]
shape = "sphere"
diameter = 1.0              # its nominal diameter is then one as well
x = 4.0
settle = true               # into its pocket: 0.82 diameters above the mean bed, an exposed grain

[contact]
friction = 0.5
gap = {gap}                  # to the bed in the computed flow; loads are corrected for it where bars are computed

[units]
diameter = {diameter:.6g}          # [m]
viscosity = {viscosity:.6g}    # kinematic [m^2/s]
fluid_density = {fluid_density:.6g}     # [kg/m^3]
grain_density = {density:.6g}        # [kg/m^3]
gravity = {gravity:.6g}              # [m/s^2]
velocity = {velocity:.6g}         # {meaning} [m/s]

[gusts]                     # for incipient entrainment
intensity = "near-wall"     # of Zanke (2003)
"""
LAMINAR = """\
[flow]                      # the turbulent mean profile; within the grain's height the flow is laminar
kind = "log-law"
shear_velocity = 1.0
roughness = 1.0             # k_s, equivalent roughness: the grains
"""
TURBULENT = """\
[flow]
kind = "open-channel"

[effects]
turbulence = true           # never switched on by itself

[turbulence]
model = "k-omega-sst"
upstream_roughness = 1.0    # k_s of the bed upstream: such grains
"""
NUMERICS = """
[numerics]
order = 2
mesh_size = 2.2             # for a first result; 1.6 or less for error bars
error_bars = false          # they take five more flows
"""


def flume_scene(answer: FlumeAnswer) -> str:
    """TOML scene of one grain in the flow of this shear velocity, for `incipient run`.

    The mean velocity of a turbulent flow is adjusted until the developed flow over the rough bed upstream has this u*.
    """
    if answer.shear_reynolds < RESOLVED:
        return _text(answer, answer.shear_velocity)
    velocity = answer.shear_velocity * 8.0
    for _ in range(6):
        reynolds = Setup(loads(_text(answer, velocity))).numbers.shear_reynolds
        assert reynolds is not None
        ratio = answer.shear_reynolds / reynolds
        if abs(ratio - 1.0) < 1e-3:
            break
        velocity *= ratio
    return _text(answer, velocity)


def _text(answer: FlumeAnswer, velocity: float) -> str:
    turbulent = answer.shear_reynolds >= RESOLVED
    depth = SHALLOWEST if answer.depth is None else answer.depth / answer.diameter
    computed = min(max(depth, SHALLOWEST), DEEPEST)
    words = f"of these {computed:.4g} above the crests of the bed"
    if answer.depth is None:
        words += "; the depth of the flume is not known"
    elif computed != depth:
        words += f", of the flume's {depth:.4g}: near the bed u* tells"
    text = HEAD.format(
        reynolds=answer.shear_reynolds,
        height=0.866 + computed,  # the crests of the bed are so high
        depth=words,
        flow=TURBULENT if turbulent else LAMINAR,
        gap=0.05 if turbulent else 0.03,
        diameter=answer.diameter,
        density=answer.density,
        viscosity=answer.viscosity,
        fluid_density=answer.fluid_density,
        gravity=answer.gravity,
        velocity=velocity,
        meaning="mean over the depth; upstream u* is then the flume's" if turbulent else "u*",
    )
    return text + NUMERICS if turbulent else text
