"""A slice of a long tube, and what it can be pressed with: the cases that have a closed form."""

import numpy as np
from tools.liner_wall.equilibrium import Friction, Tube
from tools.liner_wall.mesh import Array, TubeMesh
from tools.liner_wall.rubber import Rubber

RADIUS_MM = 12.5
SHEAR_MPA = 1.0


def ring(wall_mm: float, rubber: Rubber | None = None, ovality: float = 0.0, arcs: int = 12) -> Tube:
    """A quarter of a ring in plane strain."""
    mesh = TubeMesh.build(np.linspace(0, np.pi / 2, arcs + 1), layers=2, slabs=1)
    theta, depth, x = mesh.block.T
    radius = RADIUS_MM * (1 - ovality * np.cos(2 * theta)) + (depth - 0.5) * wall_mm
    places = np.column_stack([2.0 * x, radius * np.sin(theta), radius * np.cos(theta)])
    held = np.zeros(places.shape, bool)
    held[:, 0] = np.isclose(x, 0) | np.isclose(x, 1)
    held[np.isclose(theta, 0), 1] = True
    held[np.isclose(theta, np.pi / 2), 2] = True
    return Tube(mesh, places, rubber or Rubber(SHEAR_MPA), held, Friction(0.0, places))


def nothing(points_mm: Array) -> tuple[Array, Array]:
    """No contact."""
    return np.zeros(points_mm.shape[:-1]), np.zeros(points_mm.shape)


def on_axis(tube: Tube, nodes_mm: Array, theta: float, depth: float) -> Array:
    """(3,) place of the wall at an angle and a depth, mean over the length."""
    where = np.isclose(tube.mesh.block[:, 0], theta) & np.isclose(tube.mesh.block[:, 1], depth)
    mean: Array = nodes_mm[where].mean(axis=0)
    return mean
