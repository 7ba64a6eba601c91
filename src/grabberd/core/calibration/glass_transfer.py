"""Transfer of a calibration to a glass plate inserted since."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from grabberd.core.calibration.adjustment.adjustment import adjust
from grabberd.core.calibration.adjustment.network import Network, Unknowns
from grabberd.core.geometry import Calibration, Plate, project_through


def with_glass(calibration: Calibration, plate: Plate, places_mm: NDArray[np.float64]) -> Calibration:
    """Adjust the views of a calibration to what the rig would see through a plate.

    Equations (4)–(7) absorb the plate's effect to some thousandths of a pixel, so measuring needs no other
    model. Covariance and local fields are kept, since they belong to the mirrors and the lens. The real
    thickness and tilt of the plate are not verified; calibrating through it is better.

    Args:
        calibration: Calibration made without glass.
        plate: Plate between the cameras and the object.
        places_mm: (N, 3) positions that fill the measuring volume, in depth too; a hundred are enough.

    Raises:
        MeasurementError: The positions do not determine the views, as `adjust`.
    """
    views = calibration.views
    pictures = np.concatenate([project_through(plate, view, places_mm) for view in views])
    network = Network(
        views=views,
        view=np.repeat([0, 1], len(places_mm)),
        target=np.tile(np.arange(len(places_mm)), 2),
        xy_px=pictures,
        sigma_px=np.ones_like(pictures),
        target_mm=places_mm,
        target_sigma_mm=np.zeros_like(places_mm),
    )
    left, right = adjust(network, Unknowns.of(views)).views
    glass = {"thickness_mm": plate.thickness_mm, "refractive_index": plate.refractive_index}
    return replace(calibration, left=left, right=right, glass=glass)
