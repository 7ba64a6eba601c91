"""OpenPTV with our rig as its own calibration; runs in the peers' environment.

Its model has what the simulated rig has: the same order of rotations, radial and decentering distortion. Its
distortion is centred on the middle of the sensor, ours on the principal point, so it is told a sensor whose
middle lies within half a pixel of that. It knows fields: `chfield` makes frame lines of rows. Its pixels have
their centres at .5. Where it sees our points is compared with where we see them, and told.
"""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from optv.calibration import Calibration
from optv.correspondences import MatchedCoords, correspondences
from optv.imgcoord import image_coordinates
from optv.orientation import point_positions
from optv.parameters import ControlParams, TargetParams, VolumeParams
from optv.segmentation import target_recognition
from optv.transforms import convert_arr_metric_to_pixel

Work = tuple[Callable[[int], Any], Callable[[Any], Mapping[str, Any]]]

BAND_MM = 0.002
"""Half width of the search along an epipolar line, on the sensor; of .002 … .012 the one with most pairs."""
ODD, EVEN = 1, 2
"""Its words for fields of parity 1 and 0."""
X0, Y0, PITCH_X, PITCH_Y = 7, 8, 9, 10
"""Places of these in a view's numbers; see `given.OF_VIEW`."""


def ways(given: Mapping[str, Any]) -> dict[str, Work]:
    """Recognition alone, and all the way to points."""
    rig = OptvRig(given)
    return {
        "optv recognition": (rig.recognised, rig.places),
        "optv": (rig.points, rig.pairs),
        "optv agreement": (lambda _: rig.disagreement_px(), lambda px: {"disagreement_px": px}),
    }


class OptvRig:
    """Our two views, the pictures, and its parameters."""

    def __init__(self, given: Mapping[str, Any]) -> None:
        self._luma, self._parity = given["luma"], given["parity"].tolist()
        self._seam = int(given["end_column"][0])
        self._left = np.ascontiguousarray(self._luma[:, :, : self._seam])
        rows, columns = self._luma.shape[1:]
        self._left_size = ControlParams(2, image_size=(self._seam, rows))
        self._size = ControlParams(2, image_size=(columns, rows))
        self._target = _target_parameters(int(given["level"]))
        self._sensors = [_sensor(given["views"][0], parity) for parity in (0, 1)]
        self._cameras = [_camera(view, self._sensors[0]) for view in given["views"]]
        self._volume = _volume(float(given["depth_mm"]))
        self._object_mm, self._projected_px = given["object_mm"], given["projected_px"]

    def recognised(self, k: int) -> list[Any]:
        """Targets of both halves; a range must end at the picture's edge, so the left half is a picture."""
        return [
            target_recognition(self._left[k], self._target, 0, self._left_size),
            target_recognition(
                self._luma[k], self._target, 0, self._size, subrange_x=(self._seam, self._luma.shape[2])
            ),
        ]

    def places(self, targets: list[Any]) -> Mapping[str, Any]:
        """Columns and rows."""
        return {"places": [_column_row(one.pos()) for half in targets for one in half]}

    def points(self, k: int) -> tuple[list[Any], Any, Any]:
        """Targets, pairs of their numbers, and places in space."""
        targets, sensor = self.recognised(k), self._sensors[self._parity[k]]
        flat = [
            MatchedCoords(half, sensor, camera) for half, camera in zip(targets, self._cameras, strict=True)
        ]
        _, pairs, _ = correspondences(targets, flat, self._cameras, self._volume, sensor)
        rays = np.stack([_by_number(half, of) for half, of in zip(flat, pairs[0], strict=True)], axis=1)
        xyz_mm, _ = point_positions(rays, sensor, self._cameras, self._volume)
        return targets, pairs[0], xyz_mm

    def pairs(self, done: tuple[list[Any], Any, Any]) -> Mapping[str, Any]:
        """Columns and rows of both halves for every point, and the point."""
        targets, numbers, xyz_mm = done
        halves = [
            [_column_row(half[int(n)].pos()) for n in of] for half, of in zip(targets, numbers, strict=True)
        ]
        return {"left": halves[0], "right": halves[1], "xyz_mm": xyz_mm.tolist()}

    def disagreement_px(self) -> float:
        """How far its projection of the object's points lies from ours at most."""
        worst = 0.0
        for camera, projected in zip(self._cameras, self._projected_px, strict=True):
            for parity, sensor in enumerate(self._sensors):
                seen = image_coordinates(self._object_mm, camera, sensor.get_multimedia_params())
                pixels = convert_arr_metric_to_pixel(seen, sensor) - 0.5
                frame = np.stack([pixels[:, 0], 2 * pixels[:, 1] + parity], axis=1)
                worst = max(worst, float(np.abs(frame - projected).max()))
        return worst


def _sensor(view: Any, parity: int) -> ControlParams:
    """Its middle within half a pixel of the principal point; air before and behind a glass that is air."""
    sensor = ControlParams(
        2,
        image_size=(2 * round(view[X0] + 0.5), 2 * round(view[Y0] + 1)),
        pixel_size=(view[PITCH_X], view[PITCH_Y]),
        cam_side_n=1.0,
        wall_ns=[1.0],
        wall_thicks=[1.0],
        object_side_n=1.0,
    )
    sensor.set_chfield(ODD if parity else EVEN)
    return sensor


def _camera(view: Any, sensor: ControlParams) -> Calibration:
    width, height = sensor.get_image_size()
    beside_x_mm = (view[X0] + 0.5 - width / 2) * view[PITCH_X]
    beside_y_mm = (height / 2 - 1 - view[Y0]) * view[PITCH_Y]
    b = view[PITCH_Y + 1 :]
    return Calibration(
        pos=view[:3],
        angs=view[3:6],
        prim_point=np.array([beside_x_mm, beside_y_mm, view[6]]),
        rad_dist=b[2:5],
        decent=b[5:7],
        affine=np.array([1.0, 0.0]),
        glass=np.array([0.0, 0.0, 100.0]),
    )


def _target_parameters(level: int) -> TargetParams:
    return TargetParams(
        gvthresh=[level] * 4,
        discont=100,
        pixel_count_bounds=(4, 200),
        xsize_bounds=(2, 30),
        ysize_bounds=(1, 30),
        min_sum_grey=50,
    )


def _volume(depth_mm: float) -> VolumeParams:
    return VolumeParams(
        x_span=(-60, 60),
        z_spans=[(-depth_mm, depth_mm), (-depth_mm, depth_mm)],
        pixels_tot=0.1,
        pixels_x=0.1,
        pixels_y=0.1,
        ref_gray=0.1,
        epipolar_band=BAND_MM,
        min_correlation=0.1,
    )


def _by_number(flat: Any, numbers: Any) -> Any:
    """Places on the ideal sensor of these targets; its own look-up asks for each number in turn."""
    places, of = flat.as_arrays()
    ordered = np.empty_like(places)
    ordered[of] = places
    return ordered[numbers]


def _column_row(position: tuple[float, float]) -> list[float]:
    return [position[0] - 0.5, position[1] - 0.5]
