"""Driven cavity, the paper's Fig. 2: steady flow in a closed square whose lid slides to the right.

Scaling: side 1, lid speed 1, Reynolds number on the side. The lid's corners are watertight.
Cost:    a few seconds a Reynolds number on one core.
Run:     mpirun -n 2 python demos/cavity.py [REYNOLDS ...]
Results: results/cavity_RE: result.json, fields.xdmf for ParaView; `incipient show results/cavity_RE`
"""

import sys

from mpi4py import MPI

import incipient
from incipient.scene import Domain, Fluid, Lid, Numerics, Output, Scene

for reynolds in map(float, sys.argv[1:] or ("100", "400", "1000")):
    scene = Scene(
        title=f"Driven cavity, Re = {reynolds:g}",
        domain=Domain(kind="box", length=1.0, height=1.0),
        fluid=Fluid(reynolds=reynolds, scale="flow"),
        flow=Lid(velocity=1.0),
        numerics=Numerics(order=4),
        output=Output(pictures=False),
    )
    result = incipient.run(scene, f"results/cavity_{reynolds:g}")
    if MPI.COMM_WORLD.rank == 0:
        print(scene.title, result.text(), sep="\n")
