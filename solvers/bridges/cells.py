"""From one unknown a vertex to one a cell of vertices, for solvers that slow down with the number of unknowns."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse.csgraph import dijkstra

from nonrigid.formulations.model import Applied, Membership, Objective, Problem, Variable, free
from nonrigid.formulations.model.terms.mumford_shah import MumfordShah
from nonrigid.geometry.arrays import FloatArray, IntArray
from nonrigid.geometry.geodesics.dijkstra import virtual_edge_graph
from nonrigid.geometry.mesh import Mesh
from nonrigid.geometry.sampling import farthest_points
from nonrigid.solvers.acceptance import Claim, Rewritten
from nonrigid.solvers.judge import Values

_SHARE = 4  # vertices a cell holds at least, on average


@dataclass(frozen=True, eq=False)
class OnCells:
    """Evaluate a term at the field that is constant on each cell: f(z[cell])."""

    term: Any
    cell: IntArray
    count: int

    def value_and_gradient(self, *z: FloatArray) -> tuple[float, FloatArray]:
        """Return f and its gradient: the sums of the gradient's entries over the cells."""
        value, gradient = self.term.value_and_gradient(z[0][self.cell])
        return value, np.bincount(self.cell, gradient, self.count).astype(float)


@dataclass(frozen=True)
class RegionCells:
    """Hold a free field on the vertices of a surface constant on cells: the vertices nearest to farthest-point samples.

    A restriction: every field of the rewritten problem is one of the original, with the same objective, so its answer
    is feasible, and not better than the best of all fields. The mesh is that of the problem's `MumfordShah` term. A
    start goes forward by its means over the cells.

    Parameters
    ----------
    count
        Number of cells, at most a quarter of the vertices.

    Examples
    --------
    >>> RegionCells().claim.value
    'restriction'
    """

    count: int = 300
    name: str = "cells"
    claim: Claim = Claim.RESTRICTION

    def obstacle(self, problem: Problem) -> str | None:
        """Return why there are no cells to hold a field constant on."""
        if problem.constraints or len(problem.memberships) != 1:
            return "one variable without named constraints"
        member = problem.memberships[0]
        low, high = member.set.bounds(member.variable.shape)
        if np.isfinite(low).any() or np.isfinite(high).any() or member.set.constraints(member.variable.shape):
            return f"a free variable, not {member}"
        edge = _edge(problem)
        if edge is None:
            return "a term MumfordShah, whose mesh it takes the cells from"
        if len(edge.vertices) < 2 * _SHARE:
            return f"at least {2 * _SHARE} vertices, and the mesh has {len(edge.vertices)}"
        return None

    def apply(self, problem: Problem) -> Rewritten:
        """Return the problem over one unknown a cell."""
        edge, member = _edge(problem), problem.memberships[0]
        assert edge is not None
        count = min(self.count, len(edge.vertices) // _SHARE)
        cell = _cells(Mesh(edge.vertices, edge.faces), count)
        name = member.variable.name
        z = Variable(name, count)
        terms = tuple(
            Applied(OnCells(applied.term, cell, count), (z,), applied.weight) for applied in problem.objective.terms
        )
        objective = Objective(problem.objective.sense, terms, problem.objective.constant)
        members = np.bincount(cell, minlength=count)

        def forward(values: Values) -> Values:
            return {name: np.bincount(cell, values[name], count) / members}

        def inverse(values: Values) -> Values:
            return {name: values[name][cell]}

        return Rewritten(Problem(problem.name, objective, Membership(z, free())), forward, inverse)


def _edge(problem: Problem) -> MumfordShah | None:
    found = [applied.term for applied in problem.objective.terms if isinstance(applied.term, MumfordShah)]
    return found[0] if found else None


def _cells(mesh: Mesh, count: int) -> IntArray:
    """Return, for each vertex, the number of the sample nearest along the surface; straight where no way leads."""
    samples = farthest_points(mesh, count)
    number = np.full(len(mesh.vertices), -1)
    number[samples] = np.arange(count)
    _, _, sources = dijkstra(virtual_edge_graph(mesh), indices=samples, min_only=True, return_predecessors=True)
    reached = sources >= 0
    cell = np.where(reached, number[np.where(reached, sources, 0)], 0)
    for vertex in np.flatnonzero(~reached):
        cell[vertex] = np.argmin(np.linalg.norm(mesh.vertices[samples] - mesh.vertices[vertex], axis=1))
    return np.asarray(cell)
