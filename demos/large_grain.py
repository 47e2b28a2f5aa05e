"""A stone on the wavy bed of a turbulent open channel: its load by the k-epsilon model, and what the model makes of it.

Scaling: depth and mean velocity 1, fluid density 1; diameter 0.2, 2.65 times as dense, u* d/nu about 1600.
Cost:    about ten seconds a model on one core, and half a minute for the error bars of the standard one.
Run:     mpirun -n 2 python demos/large_grain.py [MODEL ...]
Results: results/MODEL: result.json, fields.xdmf for ParaView; `incipient show results/standard`
"""

import sys

from mpi4py import MPI

import incipient
from incipient import scene as of

NU = 5e-6
MODELS = {
    "standard": {},
    **{f"c_mu_{c}": {"c_mu": c} for c in (0.07, 0.11)},
    **{f"c_1_{c}": {"c_1": c} for c in (1.4, 1.48)},
    **{f"c_2_{c}": {"c_2": c} for c in (1.85, 1.99)},
    **{f"y_plus_{y}": {"wall_distance": y * NU / 0.0405} for y in (30, 60, 100)},
    "rough": {"wall": "rough", "roughness": 0.001},
}
CHANNEL = {
    "domain": of.Domain(length=6.0, height=1.0),
    "body": of.Disc(diameter=0.2, x=2.9375, density=2.65),
    "bed": of.Sinusoidal(amplitude=0.02, wavelength=0.25),
    "gravity": of.Gravity(acceleration=10.0),
    "contact": of.Contact(friction=0.6),
}
FLOW = {"fluid": of.Fluid(reynolds=1 / NU, scale="flow"), "flow": of.OpenChannel()}
LAMINAR = {
    "fluid": of.Fluid(reynolds=50.0, scale="grain"),
    "flow": of.LogLaw(shear_velocity=0.0421),
}

for name in sys.argv[1:] or (*MODELS, "log-law"):
    case = LAMINAR if name == "log-law" else FLOW | {"effects": of.Effects(turbulence=True)}
    if MODELS.get(name):
        case["turbulence"] = of.Turbulence(**MODELS[name])
    numerics = of.Numerics(mesh_size=2.0, order=2, error_bars=name == "standard")
    result = incipient.run(
        of.Scene(title=name, numerics=numerics, **CHANNEL, **case), f"results/{name}"
    )
    if MPI.COMM_WORLD.rank == 0:
        print(f"{name}\n{result.text()}")
