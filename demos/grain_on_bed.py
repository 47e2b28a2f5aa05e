"""A disc on a bed of half-discs in shear: which flow moves it, and how?

Scaling: grain diameter 1, shear rate 1, fluid density 1; the grain is 2.65 times as dense.
Cost:    a second or two a case on one core.
Run:     mpirun -n 2 python demos/grain_on_bed.py [GRAVITY ...]
Results: results/grain_GRAVITY: result.json, fields.xdmf for ParaView; `incipient show results/grain_GRAVITY`
"""

import sys

from mpi4py import MPI

import incipient
from incipient.scene import Contact, Disc, Domain, Fluid, Gravity, HalfDiscs, Scene, Shear

for gravity in map(float, sys.argv[1:] or ("1", "3", "10")):
    scene = Scene(
        title=f"Disc in a pocket of two half-discs, gravity {gravity:g}",
        domain=Domain(kind="channel", length=24.0, height=20.0),
        fluid=Fluid(reynolds=20.0, scale="grain"),
        flow=Shear(rate=1.0),
        body=Disc(diameter=1.0, x=16.0, density=2.65),
        bed=HalfDiscs(radius=0.5, spacing=1.2, offset=1.0),  # half-discs at 15.4 and 16.6
        gravity=Gravity(acceleration=gravity),
        contact=Contact(friction=0.5),
    )
    result = incipient.run(scene, f"results/grain_{gravity:g}")
    if MPI.COMM_WORLD.rank == 0:
        print(scene.title, result.text(), sep="\n")
