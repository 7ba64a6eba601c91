"""Rays meet the surface where geometry says, the nearest part of it, and only where data support it."""

from dataclasses import replace

import numpy as np

from core.geometry.rigs import calibration
from grabberd_liner.analysis.camera import Camera, Raster, cast
from grabberd_liner.analysis.surface.surface import Mesh
from liner.analysis.exact import PITCH_MM, exact_surface
from liner.analysis.shapes import cylinder, sheet

LEFT, RIGHT = Camera.both(calibration())
RADIUS_MM = 12.5
RASTER = Raster(RIGHT.columns, range(1, 576, 2))


def hits_of(surface, camera=RIGHT, raster=RASTER):
    return cast(surface, Mesh.of(surface), camera, raster)


def rays(raster=RASTER, camera=RIGHT):
    return camera.view.center_mm, camera.directions(raster.pixels())


def test_on_a_plane_every_ray_meets_where_it_crosses_the_plane():
    center, direction = rays()
    crossing = center - center[2] / direction[:, 2:] * direction
    hits = hits_of(exact_surface(sheet))
    met = np.isfinite(hits.u_mm)
    inside = (np.abs(crossing[:, 0]) < 4 * PITCH_MM) & (np.abs(crossing[:, 1]) < 3 * PITCH_MM)
    assert inside.sum() > 10_000
    assert (met == inside).mean() > 0.9999
    assert np.abs(hits.xyz_mm[met] - crossing[met]).max() < 1e-9
    assert np.abs(hits.u_mm[met] - 3.5 * PITCH_MM - crossing[met, 0]).max() < 1e-9


def test_on_a_cylinder_every_ray_meets_the_nearer_of_its_two_crossings():
    surface = exact_surface(lambda u, v: cylinder(RADIUS_MM, u, v), columns=12)
    center, direction = rays()
    square = (direction[:, 1:] ** 2).sum(axis=1)
    half = direction[:, 1:] @ center[1:]
    root = np.sqrt(np.maximum(half**2 - square * (center[1:] @ center[1:] - RADIUS_MM**2), 0))
    crossing = center + ((-half - root) / square)[:, np.newaxis] * direction
    hits = hits_of(surface)
    met = np.isfinite(hits.u_mm)
    assert met.sum() > 5_000
    assert np.abs(hits.xyz_mm[met] - crossing[met]).max() < 1e-4
    outward = hits.xyz_mm[met] * [0, 1, 1] / RADIUS_MM
    assert np.abs(hits.normal[met] - outward).max() < 1e-4


def test_the_inner_face_is_not_seen():
    turned_away = replace(exact_surface(sheet), outward=-1.0)
    assert not np.isfinite(hits_of(turned_away).u_mm).any()


def test_what_no_data_support_stays_empty_and_nothing_else():
    whole = hits_of(exact_surface(sheet))
    holed = hits_of(exact_surface(sheet, missing=[(3, 2), (3, 3)]))
    row, column = (np.round(place / PITCH_MM) for place in (whole.u_mm, whole.v_mm))
    hole = (row == 3) & ((column == 2) | (column == 3))
    assert hole.sum() > 500
    lost = np.isfinite(whole.u_mm) & ~np.isfinite(holed.u_mm)
    assert (lost == hole).mean() > 0.9999
    assert np.nanmax(np.abs(whole.xyz_mm - holed.xyz_mm)) == 0


def test_a_surface_behind_the_camera_is_not_seen():
    def behind(u, v):
        jets = sheet(u, v)
        jets[:, 0, 2] += 400.0
        return jets

    assert not np.isfinite(hits_of(exact_surface(behind)).u_mm).any()


def test_a_mesh_tells_places_and_tangents_like_its_surface():
    surface = exact_surface(lambda u, v: cylinder(RADIUS_MM, u, v))
    random = np.random.default_rng(1)
    u, v = random.uniform(-3, 7.5 * PITCH_MM, 500), random.uniform(-3, 5.5 * PITCH_MM, 500)
    assert np.abs(Mesh.of(surface).tangents(u, v) - surface.tangents(u, v)).max() < 1e-5
