"""A mat of pressure sensors between liner and teat: what another method would measure of the solved wall.

The cells are square and side by side on the teat, from its end towards its base. Each reads the mean contact
pressure of all of the wall's inner face that lies on it, with noise of its own.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from grabberd_fake.liner_options import LinerOptions
from grabberd_fake.optics import Array
from grabberd_fake.wall_states import Patch, unit_normals, wall_states

CSV_HEADER = "along_mm,round_deg,pressure_kpa,sigma_kpa,cell_mm,above"
_FINE_MM, _FINE_RAD = 0.25, np.deg2rad(0.5)
"""Pitch of the places on the mounted wall that are sorted into cells."""
_REACH_RAD = np.deg2rad(60.0)
"""How far round the teat the mat reaches from the line that faces the cameras, on both sides."""
_LENGTH_MM = 60.0


class Mat(NamedTuple):
    """Cells of the mat.

    Attributes:
        cell_mm: their width; `noise_kpa`: σ of a reading.
        turned_deg: by which the mat was put on turned, towards +y.
    """

    cell_mm: float = 5.0
    noise_kpa: float = 1.0
    turned_deg: float = 0.0


def mat_lines(options: LinerOptions, outer_kpa: float, mat: Mat, seed: int) -> Iterator[str]:
    """CSV lines, the header first: a reading of each cell; along the teat 0 is its end, and its base below.

    Args:
        options: of the liner.
        outer_kpa: pressure difference of the state that is measured.
        mat: the mat.
        seed: of the noise.

    Raises:
        ValueError: there is no teat, or a cell or its noise is not above 0.
    """
    teat = wall_states(options.wall).about["teat"]
    if teat is None:
        raise ValueError(f"{options.wall} has no teat that a mat could lie on")
    if not min(mat.cell_mm, mat.noise_kpa) > 0:
        raise ValueError("cells and the σ of their noise have to be above 0: --cell-mm, --noise-kpa")
    # The wall presses the teat to a little less than its own radius, so cells are as wide there as they say.
    step = mat.cell_mm / teat["radius_mm"]
    turns = int(_REACH_RAD / step)
    around = (np.arange(-turns, turns + 2) - 0.5) * step
    along = np.arange(-int(_LENGTH_MM / mat.cell_mm), 1) * mat.cell_mm
    x_mm, theta, area, kpa = _inner_face(options, outer_kpa)
    turned = theta - np.deg2rad(mat.turned_deg)
    borders = (along + teat["end_x_mm"], around)
    load, area = (np.histogram2d(x_mm, turned, borders, weights=one)[0] for one in (area * kpa, area))
    noise = np.random.default_rng(seed).normal(0.0, mat.noise_kpa, load.shape)
    read = np.divide(load, area, out=np.full_like(load, np.nan), where=area > 0) + noise
    middles = [(one[1:] + one[:-1]) / 2 for one in (along, around)]
    yield CSV_HEADER
    for (i, j), value in np.ndenumerate(read):
        if np.isfinite(value):
            place = f"{middles[0][i]:.6g},{np.rad2deg(middles[1][j]):.6g}"
            yield f"{place},{value:.6g},{mat.noise_kpa:g},{mat.cell_mm:g},liner"


def _inner_face(options: LinerOptions, outer_kpa: float) -> tuple[Array, Array, Array, Array]:
    """Places of the inner face along and round the tube, areas that they stand for, and pressures there."""
    states = wall_states(options.wall)
    half_mm = float(states.x_mm[-1])
    x_mm = np.arange(-half_mm, half_mm, _FINE_MM)
    theta = np.arange(-np.pi / 2, np.pi / 2, _FINE_RAD)
    patch = Patch(states, x_mm, theta)
    points, along, tangent = patch.frames(states.outer_mm(outer_kpa))
    inner = points - unit_normals(along, tangent) * states.about["design"]["wall_mm"]
    area = np.linalg.norm(np.cross(along, tangent), axis=-1)
    kpa = patch.values(states.contact_kpa(outer_kpa))
    return inner[..., 0].ravel(), np.arctan2(inner[..., 1], inner[..., 2]).ravel(), area.ravel(), kpa.ravel()
