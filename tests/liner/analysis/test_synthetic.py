"""The synthetic view has the grey values of what its rays meet, and none where the source saw nothing."""

import numpy as np

from core.geometry.rigs import calibration
from grabberd.core.field import Field
from grabberd_liner.analysis.camera import Camera, Raster
from grabberd_liner.analysis.synthetic import grey_at, synthetic_view
from liner.analysis.exact import PITCH_MM, exact_surface
from liner.analysis.shapes import cylinder, sheet

LEFT, RIGHT = Camera.both(calibration())
RADIUS_MM = 40.0
RASTER = Raster(RIGHT.columns, range(576))


def texture(xyz_mm):
    """Grey values by place in space, smooth enough for pixels."""
    return 128 + 60 * np.sin(xyz_mm[:, 0] / 5) + 50 * np.cos(xyz_mm[:, 1] / 4)


def crossings(camera, raster, radius):
    """Where the raster's rays cross the plane z = 0 or the cylinder round x: NaN where they do not."""
    center, direction = camera.view.center_mm, camera.directions(raster.pixels())
    if radius is None:
        return center - center[2] / direction[:, 2:] * direction
    square, half = (direction[:, 1:] ** 2).sum(axis=1), direction[:, 1:] @ center[1:]
    inside = half**2 - square * (center[1:] @ center[1:] - radius**2)
    root = np.sqrt(np.where(inside > 0, inside, np.nan))
    return center + ((-half - root) / square)[:, np.newaxis] * direction


def painted(camera, radius):
    """The picture that the camera takes of the textured object."""
    raster = Raster(range(720), range(576))
    grey = np.nan_to_num(texture(crossings(camera, raster, radius)))
    return Field(np.round(grey).astype(np.uint8).reshape(raster.shape), 0, 0, 1)


def check(shape, radius):
    surface = exact_surface(shape)
    view = synthetic_view(surface, RIGHT, RASTER, LEFT, painted(LEFT, radius))
    truth = texture(crossings(RIGHT, RASTER, radius)).reshape(RASTER.shape)
    assert view.filled.sum() > 20_000
    error = (view.grey - truth)[view.filled]
    assert np.abs(error).max() < 1.5
    assert error.std() < 0.5
    assert abs(error.mean()) < 0.1


def test_a_textured_plane_looks_from_the_right_as_it_does():
    check(sheet, None)


def test_a_textured_cylinder_looks_from_the_right_as_it_does():
    def standing(u, v):
        return cylinder(RADIUS_MM, u, v)

    check(standing, RADIUS_MM)


def waves(u, v):
    """Steep ridges along x: each hides the valley behind it."""
    jets = sheet(u, v)
    for j in range(5):
        jets[:, j * (j + 1) // 2 + j, 2] += 10.0 * np.cos(v / 3 + j * np.pi / 2) / 3**j
    return jets


def test_what_a_ridge_hides_from_the_source_stays_empty():
    view = synthetic_view(exact_surface(waves), RIGHT, RASTER, LEFT, painted(LEFT, None))
    met = np.isfinite(view.hits.u_mm)
    place = view.hits.xyz_mm[met]
    share = np.linspace(0, 0.12, 200)[1:, np.newaxis, np.newaxis]
    path = place + share * (LEFT.view.center_mm - place)
    over = (np.abs(path[..., :2]) < [4 * PITCH_MM, 3 * PITCH_MM]).all(axis=-1)
    below = np.where(over, 10.0 * np.cos(path[..., 1] / 3) - path[..., 2], -np.inf).max(axis=0)
    filled = view.filled.ravel()[met]
    assert (~filled).sum() > 1000
    assert not filled[below > 1.0].any()
    assert filled[below < -0.2].mean() > 0.98


def test_an_intact_field_is_interpolated_between_its_own_lines():
    luma = np.arange(12, dtype=np.uint8).reshape(3, 4) * 10
    field = Field.intact(luma, 1)
    assert grey_at(field, np.array([[1.5, 2.0]])) == [35.0]
    assert np.isnan(grey_at(field, np.array([[1.5, 0.5], [3.5, 2.0], [-0.1, 2.0]]))).all()
