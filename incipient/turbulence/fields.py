"""Both quantities of a turbulence model on a mesh: unknowns, equations, and an implicit step."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import dolfinx
import numpy as np
import ufl
from mpi4py import MPI
from petsc4py import PETSc

from .. import compat
from ..arrays import Floats
from ..compat import petsc
from ..fluid import Fluid, newton
from ..fluid.solvers.direct import Direct
from ..fluid.space import cell_size, size_along
from ..forms import turbulence as forms
from ..forms.k_omega_sst import INNER, KOmegaSST
from ..mesh.domain import Domain, is_node_of
from ..mesh.wall_distance import cells_at, distances
from ..parallel import Owner

Values = Callable[[np.ndarray], np.ndarray]
ORDER = 2
FAR = 1e9  # distance where there are no walls
# Of the thickness of the cells at a wall: distance of the nodes on it, where omega would be infinite. Then the parabola
# of ln omega = -2 ln d between those nodes, the middle of a cell and its outer edge has the slope of -2 ln d there.
ON_SURFACE = math.e / 16.0
MOST_CORRECTIONS = 20
LINEAR = 1e-4  # residual of a linear system: corrections follow until they are small
LARGEST_CORRECTION = 2.0  # of a logarithm by Newton's method at once
# Part of a step by which the state that decides on upwinding follows the present one, in 2-D and past grains in 3-D:
# with 1, states of single nodes alternate. A sphere in a pocket at u* d/nu = 300 takes 61 iterations with 0.5, 47 with
# 0.25; with first cells of y+ 5 it takes 46 with 0.2 and does not converge in 150 with 0.5. 2-D flows take as many with
# 0.25; with it the threshold of a stone at u* d/nu = 2000 comes upon a flow that separates elsewhere.
FOLLOWS, FOLLOWS_GRAIN = 0.5, 0.25
SAME_RATE = 0.3  # change of a0 of the difference in time up to which factors are kept
LARGEST_SEEN = 10.0  # of a change of a logarithm at one node


class TurbulenceFields(Owner):
    """Logarithms of k and of a second quantity in Lagrange elements. Every method is collective.

    Holds PETSc objects: use it as a context manager, or call `destroy`.

    Args:
        values: at the inflow, (2, n), a function of positions (3, n).
        inflow: names of boundaries at which the logarithms are prescribed.
        walls: distances from the mesh by names of wall boundaries.
        surfaces: smooth walls resolved into the viscous sublayer: omega is prescribed in the cells at them.
        viscosity: molecular.
        k_epsilon: the closure; None: the k-omega SST model.
        order_of_flow: of the velocity, whose strain limits the SST model's eddy viscosity.
        least: k below which that model destroys none.
        in_layers: whether layers of thin cells lie along curved walls.
        weighted: whether the equation of k is that of k itself, see `forms.turbulence.FlowFields`.
        order: of the elements of both logarithms.

    Attributes:
        state: function (2,) of the logarithms.
        form, of_molecules: residual in UFL, and molecular viscosity, after `carried_by`.
    """

    form: Any
    of_molecules: Any

    def __init__(
        self,
        domain: Domain,
        values: Values,
        inflow: Sequence[str] = (),
        walls: Mapping[str, float] | None = None,
        viscosity: float = 1.0,
        k_epsilon: forms.KEpsilon | None = None,
        order_of_flow: int = 2,
        least: float = 0.0,
        in_layers: bool = False,
        order: int = ORDER,
        surfaces: Sequence[str] = (),
        weighted: bool = False,
    ):
        super().__init__(domain.comm)
        self.domain, self.order, self._molecules = domain, order, viscosity
        self.space = compat.space(domain.mesh, ("Lagrange", order), (2,))
        self.state, self._before, self._older = (dolfinx.fem.Function(self.space) for _ in range(3))
        self.rate = tuple(self.constant(0.0) for _ in range(3))
        self._inflow, self._given = tuple(inflow), dolfinx.fem.Function(self.space)
        self.conditions = self._at_inflow(values)
        self.state.interpolate(values)
        self._walls = {name: self.constant(away) for name, away in (walls or {}).items()}
        self._in_layers, self.weighted = in_layers, weighted
        self._distance = dolfinx.fem.Function(compat.space(domain.mesh, ("Lagrange", order)))
        self._distance.x.array[:] = FAR
        self._least = self.constant(least)
        self.closure: Any = k_epsilon or KOmegaSST(self._distance, self._least)
        self._surfaces = () if k_epsilon else tuple(surfaces)
        self._at_surfaces = dolfinx.fem.Function(self._distance.function_space)
        if self._surfaces:
            self._at = cells_at(domain, self._surfaces)
            near = np.flatnonzero(is_node_of(self._at_surfaces.function_space, self._at))
            pairs = [(2 * near + 1).astype(np.int32), near.astype(np.int32)]
            of_omega = dolfinx.fem.dirichletbc(self._at_surfaces, pairs, self.space.sub(1))
            self.conditions = [*self.conditions, of_omega]
        self._seen = dolfinx.fem.Function(
            compat.space(domain.mesh, ("Lagrange", order_of_flow), (domain.gdim,))
        )
        self._fluid: Fluid | None = None
        self.follow()

    @property
    def wanted(self) -> tuple[float, float]:
        """Wanted changes per iteration of a logarithm, and of a velocity over the largest speed, at a node.

        A backward-facing step by k-omega SST diverges with twice as large ones (docs/contribute/defaults.md).
        """
        plain = self.weighted or isinstance(self.closure, forms.KEpsilon)
        return (1.0, 0.1) if plain else (0.5, 0.05)

    @property
    def names(self) -> str:
        return f"k and {self.closure.second}"

    def constant(self, value: float) -> Any:
        return dolfinx.fem.Constant(self.domain.mesh, PETSc.ScalarType(value))

    def _at_inflow(self, values: Values) -> list[Any]:
        if not self._inflow:
            return []
        self._given.interpolate(values)
        facets = np.concatenate([self.domain.facets_of(name) for name in self._inflow])
        return [
            dolfinx.fem.dirichletbc(self._given, compat.nodes_on(self.space, np.unique(facets)))
        ]

    def give(
        self, values: Values, viscosity: float, walls: Mapping[str, float], least: float
    ) -> None:
        self._given.interpolate(values)
        self._molecules, self._least.value = viscosity, least
        for name, away in walls.items():
            self._walls[name].value = away
        self.follow()

    def follow(self) -> None:
        if not self._walls or not isinstance(self.closure, KOmegaSST):
            return
        places = self._distance.function_space.tabulate_dof_coordinates()[:, : self.domain.gdim]
        beyond = {name: float(distance.value) for name, distance in self._walls.items()}
        beyond |= dict.fromkeys(self._surfaces, 0.0)
        away = [distances(self.domain, [name], places) + more for name, more in beyond.items()]
        least = np.min(away, axis=0)
        if self._surfaces:
            least = np.maximum(least, ON_SURFACE * self._thicknesses(least))
            # In the viscous sublayer omega = 6 nu/(beta y^2) (Wilcox 1988, AIAA J. 26, 1299).
            omega = 6.0 * self._molecules / (INNER[2] * least**2)
            self._at_surfaces.x.array[:] = np.log(omega)
        self._distance.x.array[:] = least

    def _thicknesses(self, away: Floats) -> Floats:
        """Thickness (nodes,) of the thinnest cell at a surface with the node, zero elsewhere. Collective."""
        dofs = compat.cell_dofs(self._distance.function_space)[self._at]
        inverse = dolfinx.fem.Function(self._distance.function_space)
        np.maximum.at(inverse.x.array, dofs, 1.0 / away[dofs].max(axis=1, keepdims=True))
        view = compat.vec_view(inverse)  # a rank has not all cells of its nodes
        view.ghostUpdate(addv=PETSc.InsertMode.MAX_VALUES, mode=PETSc.ScatterMode.REVERSE)
        view.destroy()
        inverse.x.scatter_forward()
        near = inverse.x.array > 0.0
        return np.divide(1.0, inverse.x.array, where=near, out=np.zeros(len(near)))

    # -- what the flow sees of it ------------------------------------------------------------------

    def viscosity(self, of_molecules: Any) -> Any:
        """Molecular plus eddy viscosity, for `FlowModel.viscosity`, limited by the strain at the last `look`."""
        flow = forms.FlowFields(self._seen, of_molecules, None)
        return of_molecules + self.closure.eddy_viscosity(ufl.split(self.state), flow)

    def shear_velocity(self) -> Any:
        """u* of a logarithmic layer of this k, for `FlowModel.shear_velocity`."""
        return forms.shear_velocity(ufl.split(self.state), self.closure)

    def watch(self, fluid: Fluid) -> None:
        self._fluid = fluid
        self.look()

    def look(self) -> None:
        """Store the present flow."""
        if self._fluid is not None:
            self._seen.interpolate(self._fluid.velocity)

    def watching(self, form: Any, velocity: Any) -> Any:
        """Form whose eddy viscosity depends on a velocity (UFL) instead of the stored flow."""
        return ufl.replace(form, {self._seen: velocity})

    # -- a steady state, solved together with the flow ------------------------------------------------

    def weights(self) -> Floats:
        """Fraction (owned nodes,) of the eddy viscosity before its limitation by strain."""
        k, second = self._at_nodes()
        constant, of_k, of_second = self.closure.eddies
        eddies = np.exp(np.clip(constant + of_k * k + of_second * second, -100.0, 100.0))
        return np.asarray(eddies / (self._molecules + eddies))

    def row_factors(self) -> Floats:
        """Factors (owned unknowns,) that undo the weights of both equations at their nodes."""
        factors = np.ones_like(self._at_nodes())
        if self.weighted:
            factors[0] = np.exp(-self._at_nodes()[0])
        return factors.T.ravel()

    def _at_nodes(self) -> Floats:
        """Both logarithms (2, owned nodes)."""
        return np.asarray(
            self.state.x.array[: 2 * self.space.dofmap.index_map.size_local].reshape(-1, 2).T
        )

    def impose(self) -> None:
        compat.impose(self.state.x.array, self.conditions)
        self.state.x.scatter_forward()
        self._before.x.array[:] = self.state.x.array

    def hold(self) -> None:
        """Prepare for a Newton update in steady flow; lagged quantities follow by a part of a step."""
        for factor in self.rate:
            factor.value = 0.0
        known, follows = self._before.x.array, FOLLOWS_GRAIN if self.weighted else FOLLOWS
        known += follows * (self.state.x.array - known)

    # -- its equations ------------------------------------------------------------------------------

    def carried_by(
        self, velocity: Any, of_molecules: Any, added: Any = (0, 0), carrier: Any = None
    ) -> None:
        """Compile the equations of the turbulence that a velocity carries and produces.

        Arguments are UFL; `added` (2,) are further sources, `carrier` the velocity relative to the mesh, see
        `forms.turbulence.FlowFields`.
        """
        mesh, unknowns, tests = (
            self.domain.mesh,
            ufl.split(self.state),
            ufl.TestFunctions(self.space),
        )
        measure = ufl.dx(domain=mesh, metadata={"quadrature_degree": 3 * self.order + 1})
        states = (unknowns, ufl.split(self._before), ufl.split(self._older))
        size = cell_size(mesh) / self.order
        flow = forms.FlowFields(
            velocity,
            of_molecules,
            measure,
            size,
            states[1],
            added,
            carrier,
            self.rate[0],
            self._reach,
            # In 3-D as many steps are needed without, and no more flows converge with it.
            balanced=self._in_layers and not self.weighted,
            weighted=self.weighted,
        )
        rate = [
            sum(a * state[i] for a, state in zip(self.rate, states, strict=True)) for i in range(2)
        ]
        self.form = self._equations(rate, tests, flow)
        self.of_molecules = of_molecules
        self.solver: Direct | None = None  # made at the first step in time
        self.renew_factors()

    def _make_solver(self) -> Direct:
        self._residual = compat.form(self.form)
        self._jacobian = compat.form(
            ufl.derivative(self.form, self.state, ufl.TrialFunction(self.space))
        )
        self._matrix = self.holding(petsc.create_matrix(self._jacobian))
        self._vector = self.holding(petsc.assemble_vector(self._residual))
        self._correction = self.holding(self._vector.duplicate())
        return self.holding(Direct(self._matrix))

    @property
    def _reach(self) -> Any:
        """Cell size along a direction, for `forms.turbulence.FlowFields`; None: streamline upwinding.

        Stretched cells grow away from walls faster than the logarithms allow with streamline upwinding alone.
        """
        if not self._in_layers:
            return None
        return lambda direction: size_along(self.domain.mesh, direction) / self.order

    def _equations(self, rate: Any, tests: Any, flow: forms.FlowFields) -> Any:
        logarithms = ufl.split(self.state)
        form = forms.residual(logarithms, rate, tests, flow, self.closure)
        for name, away in self._walls.items():
            flux = forms.at_walls(logarithms, tests, away, flow, self.closure)
            form += flux * self.domain.measure(name)(metadata=flow.measure.metadata())
        return form

    def step(self, rate: Sequence[float], past: Sequence[np.ndarray], tolerance: float) -> float:
        """Solve with dK/dt = a0 K + a1 K(1) + a2 K(2) from the present state; returns the error of Newton's method.

        That of a logarithm, at most; infinite without convergence. Factorisations are reused while updates shrink well.
        """
        self.solver = self.solver or self._make_solver()
        fresh = abs(rate[0] - self._rate_of_factors) > SAME_RATE * abs(rate[0])
        for constant, value in zip(self.rate, rate, strict=True):
            constant.value = value
        for function, values in zip((self._before, self._older), past, strict=False):
            function.x.array[:] = values
        report = newton.solve(self, tolerance, MOST_CORRECTIONS, fresh=fresh)
        if not report.converged:
            self.renew_factors()
        return report.error if report.converged else float("inf")

    def renew_factors(self) -> None:
        self._rate_of_factors = np.inf

    def correction(self, fresh: bool, rtol: float | None) -> float:
        """Subtract a Newton update (see `newton.System`); returns the largest change of a logarithm."""
        assert self.solver is not None
        compat.impose(self.state.x.array, self.conditions)
        compat.vector_of(self._residual, self._vector)
        compat.set_zero(self._vector, self.conditions)
        if fresh:
            compat.matrix_of(self._jacobian, self.conditions, self._matrix)
            self._rate_of_factors = float(self.rate[0].value)
        self.solver.solve(self._vector, self._correction, LINEAR, fresh=fresh)
        values = self._correction.array_r
        mine = float(np.abs(values).max(initial=0.0))
        size = self.domain.comm.allreduce(mine if np.isfinite(mine) else np.inf, op=MPI.MAX)
        part = min(1.0, LARGEST_CORRECTION / size) if np.isfinite(size) and size > 0.0 else 1.0
        self.state.x.array[: len(values)] -= part * values
        self.state.x.scatter_forward()
        return float(size)

    def usual_change(self, values: np.ndarray) -> float:
        """Root mean square of a change (owned unknowns,), by the weights of the nodes. Collective."""
        sizes = np.where(np.isfinite(values), np.abs(values), np.inf)
        if not np.isfinite(self.domain.comm.allreduce(sizes.sum())):
            return float("inf")
        weights = self.weights()
        seen = np.repeat(weights, 2)[: len(sizes)] * np.minimum(sizes, LARGEST_SEEN)
        total, count = (
            self.domain.comm.allreduce(float((seen**2).sum())),
            self.domain.comm.allreduce(float((weights**2).sum())),
        )
        return float(np.sqrt(0.5 * total / count))
