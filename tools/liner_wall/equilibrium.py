"""The tube's equilibrium: Newton's method on the nodes' positions, with the bricks' pressures condensed."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tools.liner_wall.mesh import Array, Face, TubeMesh
from tools.liner_wall.rubber import Rubber
from tools.liner_wall.slabs import is_stable, solve_slabs

Push = Callable[[Array], tuple[Array, Array]]
"""Pressure (F, Q) and its gradient (F, Q, 3) at points (F, Q, 3) of the inner face."""

_TOLERANCE_N = 1e-6
"""Of any node's out-of-balance force: a millionth of what 1 kPa does to a facet."""
_STEPS = 40
_LONGEST_STEP_MM = 1.0
"""Longer steps are shortened: a wall that is near buckling sends Newton's method far away."""
_STICK_MM = 0.2
"""Slip at which friction has .7 of its full size: rubber on wet skin creeps before it slides."""


class Friction(NamedTuple):
    """Friction on the inner face.

    Attributes:
        coefficient: of Coulomb's law.
        anchors_mm: (N, 3) positions of the nodes from which slip counts: the mounted tube.
    """

    coefficient: float
    anchors_mm: Array


class NoEquilibrium(ArithmeticError):
    """Newton's method found none from where it began."""


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """A state of the tube.

    Attributes:
        nodes_mm: (N, 3) positions of the nodes.
        pressures_mpa: (E, 4) pressures of the bricks.
    """

    nodes_mm: Array
    pressures_mpa: Array


class Tube:
    """A meshed tube with its rubber and its held nodes."""

    def __init__(
        self,
        mesh: TubeMesh,
        undeformed_mm: Array,
        rubber: Rubber,
        held: NDArray[np.bool_],
        friction: Friction,
    ) -> None:
        """Prepares the bricks' shape functions in the undeformed tube.

        Args:
            mesh: its bricks.
            undeformed_mm: (N, 3) positions of the nodes without stress.
            rubber: its law.
            held: (N, 3) true for coordinates that keep the value they have.
            friction: of the inner face on what it touches.
        """
        self.mesh, self.rubber, self._held = mesh, rubber, held
        self.undeformed_mm, self.friction = undeformed_mm, friction
        bricks = mesh.bricks
        jacobian = np.einsum("eqaJ,eai->eqiJ", bricks.slopes, undeformed_mm[bricks.nodes])
        self._slopes = bricks.slopes @ np.linalg.inv(jacobian)
        self._weights = bricks.weights * np.linalg.det(jacobian)
        self._pressures = bricks.pressures
        mass = np.einsum("eq,eqm,eqn->emn", self._weights, self._pressures, self._pressures)
        self._compliance = np.linalg.inv(mass) * rubber.bulk_mpa

    def at_rest(self) -> State:
        """The tube without stress."""
        return State(self.undeformed_mm.copy(), np.zeros((len(self._weights), 4)))

    def gradient(self, nodes_mm: Array) -> Array:
        """(E, Q, 3, 3) deformation gradient."""
        gradient: Array = np.einsum("eqaJ,eai->eqiJ", self._slopes, nodes_mm[self.mesh.bricks.nodes])
        return gradient

    def stress_mpa(self, state: State) -> Array:
        """(E, Q, 3, 3) Cauchy stress."""
        gradient = self.gradient(state.nodes_mm)
        nominal = self.rubber.stress(gradient, self._pressure(state))
        volume = np.linalg.det(gradient)[..., np.newaxis, np.newaxis]
        stress: Array = nominal @ np.swapaxes(gradient, -1, -2) / volume
        return stress

    def solve(
        self, start: State, outer_mpa: float, push: Push, drag: float = 0.0, within_mm: float = np.inf
    ) -> State:
        """Equilibrium under `outer_mpa` on the outer face and `push` on the inner one.

        Args:
            start: where to begin; its held coordinates stay.
            outer_mpa: pressure on the outer face over the gas inside.
            push: contact on the inner face.
            drag: N/mm of a node's viscous drag against leaving `start`: a step in time where there is no
                equilibrium near by.
            within_mm: give up as soon as a node is farther from where it began.

        Raises:
            NoEquilibrium: none was found.
        """
        state, step_mm = start, np.inf
        for _ in range(_STEPS):
            residual, blocks, volumetric = self._linearised(state, outer_mpa, push)
            residual += drag * (start.nodes_mm - state.nodes_mm)
            residual[self._held] = 0.0
            largest = float(np.abs(residual).max())
            if largest < _TOLERANCE_N and step_mm < 1e-3:
                return state
            strayed_mm = np.abs(state.nodes_mm - start.nodes_mm).max()
            if not np.isfinite(largest) or strayed_mm > within_mm:
                break
            change = solve_slabs(self.mesh, blocks, residual, self._held, drag)
            step_mm = float(np.abs(change).max())
            damping = min(1.0, _LONGEST_STEP_MM / step_mm)
            state = self._moved(state, damping * change, damping, volumetric)
        raise NoEquilibrium(f"no equilibrium at {1000 * outer_mpa:.3g} kPa: {largest:.3g} N are left")

    def is_stable(self, state: State, outer_mpa: float, push: Push) -> bool:
        """True if a state of equilibrium holds against any small push."""
        _, blocks, _ = self._linearised(state, outer_mpa, push)
        return is_stable(self.mesh, blocks, self._held)

    def _pressure(self, state: State) -> Array:
        pressure: Array = np.einsum("eqm,em->eq", self._pressures, state.pressures_mpa)
        return pressure

    def _moved(self, state: State, change: Array, damping: float, volumetric: tuple[Array, Array]) -> State:
        """State after a step; bricks' pressures follow from the linearised volumes."""
        misfit, by_node = volumetric
        moved = change[self.mesh.bricks.nodes]
        volumes = damping * misfit + np.einsum("emai,eai->em", by_node, moved)
        pressures = state.pressures_mpa + np.einsum("emn,en->em", self._compliance, volumes)
        return State(state.nodes_mm + change, pressures)

    def _linearised(
        self, state: State, outer_mpa: float, push: Push
    ) -> tuple[Array, tuple[Array, Array, Array], tuple[Array, Array]]:
        """Out-of-balance forces (N, 3), stiffness of bricks and facets, and the bricks' volumes."""
        gradient = self.gradient(state.nodes_mm)
        pressure = self._pressure(state)
        weights, slopes = self._weights, self._slopes
        weighted = weights[..., np.newaxis, np.newaxis]
        forces = np.zeros_like(state.nodes_mm)
        inside = np.einsum("eqiJ,eqaJ->eai", weighted * self.rubber.stress(gradient, pressure), slopes)
        np.subtract.at(forces, self.mesh.bricks.nodes, inside)
        volume = np.linalg.det(gradient)
        cofactor = volume[..., np.newaxis, np.newaxis] * np.swapaxes(np.linalg.inv(gradient), -1, -2)
        by_node = np.einsum(
            "eqm,eqiJ,eqaJ->emai", self._pressures, weighted * cofactor, slopes, optimize=True
        )
        excess = weights * (volume - 1 - pressure / self.rubber.bulk_mpa)
        misfit = np.einsum("eqm,eq->em", self._pressures, excess)
        brick = self._brick_stiffness(gradient, pressure)
        spring = np.einsum("emn,enbk->embk", self._compliance, by_node)
        brick += np.einsum("emai,embk->eaibk", by_node, spring, optimize=True)
        np.subtract.at(forces, self.mesh.bricks.nodes, np.einsum("em,emai->eai", misfit, spring))
        outer = _facet_load(self.mesh.outer, state.nodes_mm, lambda _: (np.array(-outer_mpa), np.zeros(3)))
        inner = _facet_load(self.mesh.inner, state.nodes_mm, push)
        if self.friction.coefficient:
            rubbing = _facet_friction(self.mesh.inner, state.nodes_mm, push, self.friction)
            inner = (inner[0] + rubbing[0], inner[1] + rubbing[1])
        for face, (load, _) in ((self.mesh.outer, outer), (self.mesh.inner, inner)):
            np.add.at(forces, face.nodes, load)
        return forces, (brick, -outer[1], -inner[1]), (misfit, by_node)

    def _brick_stiffness(self, gradient: Array, pressure: Array) -> Array:
        """(E, 27, 3, 27, 3) of the bricks at constant pressure."""
        stiffness = self.rubber.stiffness(gradient, pressure)
        stiffness *= self._weights[..., np.newaxis, np.newaxis, np.newaxis, np.newaxis]
        count, points = self._weights.shape
        slopes = self._slopes.transpose(0, 2, 1, 3)
        half = np.einsum("eqiJkL,eqbL->eqJikb", stiffness, self._slopes, optimize=True)
        left = slopes.reshape(count, 27, points * 3)
        whole = left @ half.reshape(count, points * 3, 9 * 27)
        return np.ascontiguousarray(whole.reshape(count, 27, 3, 3, 27).transpose(0, 1, 2, 4, 3))


def _facet_load(face: Face, nodes_mm: Array, push: Push) -> tuple[Array, Array]:
    """Forces (F, 27, 3) of a pressure along the radial normal, and their derivatives (F, 27, 3, 27, 3)."""
    corners = nodes_mm[face.nodes]
    points = face.shapes @ corners
    round_, along = face.by_theta @ corners, face.by_x @ corners
    area = np.cross(along, round_)
    pressure, slope = push(points)
    shapes = face.weights[..., np.newaxis] * face.shapes
    load = np.einsum("fqa,fqi->fai", shapes, pressure[..., np.newaxis] * area)
    by_point = np.einsum("...i,...k->...ik", area, np.broadcast_to(slope, area.shape))
    derivative = np.einsum("fqa,fqik,fqb->faibk", shapes, by_point, face.shapes, optimize=True)
    loaded = shapes * pressure[..., np.newaxis]
    # d(along × round) = d(along) × round + along × d(round), as matrices that act on the nodes' shifts.
    for turn, by in ((-_crossing(round_), face.by_x), (_crossing(along), face.by_theta)):
        derivative += np.einsum("fqa,fqik,fqb->faibk", loaded, turn, by, optimize=True)
    return load, derivative


def _facet_friction(face: Face, nodes_mm: Array, push: Push, friction: Friction) -> tuple[Array, Array]:
    """Forces (F, 27, 3) of friction and most of their derivatives (F, 27, 3, 27, 3).

    The turning of the face under a given slip is left out of the derivatives: it is small, and Newton's
    method ends where the forces vanish, whatever its steps.
    """
    corners = nodes_mm[face.nodes]
    points = face.shapes @ corners
    area = np.cross(face.by_x @ corners, face.by_theta @ corners)
    size = np.linalg.norm(area, axis=-1)
    normal = area / size[..., np.newaxis]
    tangential = np.eye(3) - normal[..., :, np.newaxis] * normal[..., np.newaxis, :]
    slip = points - face.shapes @ friction.anchors_mm[face.nodes]
    slip = np.einsum("...ik,...k->...i", tangential, slip)
    pressure, slope = push(points)
    length = np.sqrt((slip**2).sum(axis=-1) + _STICK_MM**2)[..., np.newaxis]
    direction = -friction.coefficient * slip / length
    shapes = (face.weights * size)[..., np.newaxis] * face.shapes
    load = np.einsum("fqa,fqi->fai", shapes, pressure[..., np.newaxis] * direction)
    turned = np.eye(3) - slip[..., :, np.newaxis] * slip[..., np.newaxis, :] / length[..., np.newaxis] ** 2
    by_slip = (
        -friction.coefficient * (pressure[..., np.newaxis] / length)[..., np.newaxis] * (turned @ tangential)
    )
    by_point = by_slip + direction[..., :, np.newaxis] * slope[..., np.newaxis, :]
    return load, np.einsum("fqa,fqik,fqb->faibk", shapes, by_point, face.shapes, optimize=True)


def _crossing(vectors: Array) -> Array:
    """(…, 3, 3) matrices of v × ·."""
    x, y, z = np.moveaxis(vectors, -1, 0)
    zero = np.zeros_like(x)
    rows = [[zero, -z, y], [z, zero, -x], [-y, x, zero]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
