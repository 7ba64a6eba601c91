"""Table of a case: its outer face, contact pressure and load in each state, as small integers."""

import json
from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from tools.liner_wall.designs import Case
from tools.liner_wall.equilibrium import Push, Tube
from tools.liner_wall.mesh import Array
from tools.liner_wall.path import Rest

SHIFT_MM = 5e-4
"""Step of a shift; 16 bits then reach 16 mm, more than the wall's radius."""
CONTACT_KPA = 2e-3
"""Step of a contact pressure; 16 bits then reach 65 kPa."""


def save_table(path: Path, case: Case, tube: Tube, rests: Iterable[Rest]) -> None:
    """Writes the states of a case in the order of their pressure difference.

    The file holds `theta` (A,) and `x_mm` (X,) of the mounted outer nodes, `mounted_mm` (X, A, 3),
    `outer_kpa` (S,), `shift` (S, X, A, 3) and `contact` (S, X, A) as differences from state to state in steps
    of `shift_mm` and `contact_kpa`, `force_n_per_mm` (S, X/2) of the upper side over each slab's present
    length, `snapped` (S,), and `about`, the case as JSON.
    """
    rests = list(rests)
    push = case.push(tube.mesh.inner_angles())
    theta, depth, _ = tube.mesh.block.T
    mounted = tube.friction.anchors_mm
    outer = _grid(tube, np.flatnonzero(np.isclose(depth, 1.0)))
    inner = _grid(tube, np.flatnonzero(np.isclose(depth, 0.0)))
    shifts = np.stack([(rest.state.nodes_mm - mounted)[outer] for rest in rests])
    at_nodes = case.push(theta[inner])
    contact = np.stack([1000 * at_nodes(rest.state.nodes_mm[inner])[0] for rest in rests])
    np.savez_compressed(
        path,
        theta=theta[outer[0]],
        x_mm=mounted[outer[:, 0], 0],
        mounted_mm=mounted[outer],
        outer_kpa=np.array([1000 * rest.outer_mpa for rest in rests]),
        shift_mm=SHIFT_MM,
        contact_kpa=CONTACT_KPA,
        shift=_differences(shifts / SHIFT_MM),
        contact=_differences(contact / CONTACT_KPA),
        force_n_per_mm=np.stack([force_n_per_mm(tube, rest.state.nodes_mm, push) for rest in rests]),
        snapped=np.array([rest.snapped for rest in rests]),
        about=np.array(json.dumps(_about(case))),
    )


def force_n_per_mm(tube: Tube, nodes_mm: Array, push: Push) -> Array:
    """(slabs,) force of the upper wall on what it touches, along z, per present length."""
    face = tube.mesh.inner
    corners = nodes_mm[face.nodes]
    area = np.cross(face.by_x @ corners, face.by_theta @ corners)
    pressure, _ = push(face.shapes @ corners)
    theta = tube.mesh.inner_angles()
    upper = np.abs(theta) < np.pi / 2
    # Where the mesh has one flank alone, its force is half of that on the upper side.
    flanks = 1 if theta.min() < 0 else 2
    each = flanks * (face.weights * upper * pressure * area[..., 2]).sum(axis=1)
    slab = face.nodes.min(axis=1) // (2 * tube.mesh.per_section)
    sections = nodes_mm[:, 0].reshape(tube.mesh.sections, -1).mean(axis=1)
    per_mm: Array = np.bincount(slab, each) / np.diff(sections[::2])
    return per_mm


def _grid(tube: Tube, nodes: Any) -> Any:
    """(X, A) node numbers of a face."""
    return nodes.reshape(tube.mesh.sections, -1)


def _differences(steps: Array) -> Any:
    rounded = np.rint(steps).astype(np.int64)
    small = np.diff(rounded, axis=0, prepend=0)
    if np.abs(small).max() >= 2**15:
        raise OverflowError(f"two states differ by {np.abs(small).max()} steps: 16 bits hold 32767")
    return small.astype(np.int16)


def _about(case: Case) -> dict[str, Any]:
    return {"design": asdict(case.design), "teat": asdict(case.teat) if case.teat else None}
