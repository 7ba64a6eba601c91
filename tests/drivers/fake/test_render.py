"""Ellipses into grey values."""

from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose
from numpy.typing import NDArray

from grabberd_fake.optics import Array, Ellipses, Targets, View, disc_images
from grabberd_fake.options import PictureOptions
from grabberd_fake.render import SCALE, Renderer
from grabberd_fake.world import World

FINE = 16
"""Sub-samples a pixel in the supersampled pictures."""
QUIET = np.zeros(288)


def round_spots(*places: tuple[float, float], radius: float = 2.8) -> Ellipses:
    count = len(places)
    a, b = np.tile([radius, 0.0], (count, 1)), np.tile([0.0, radius], (count, 1))
    return Ellipses(np.array(places, np.float64).reshape(count, 2), a, b, np.ones(count))


def drawn(left: Ellipses, right: Ellipses, parity: int = 0, shift: Array = QUIET, **picture: Any) -> Array:
    """(288, 720) grey values above the background."""
    canvas = Renderer(PictureOptions(**picture)).draw((left, right), parity, shift)
    return canvas.reshape(288, 720) / SCALE


def centroid(grey: Array, parity: int = 0) -> tuple[float, float]:
    rows, columns = np.mgrid[: grey.shape[0], : grey.shape[1]]
    return float((grey * columns).sum() / grey.sum()), float((grey * (2 * rows + parity)).sum() / grey.sum())


def test_light_is_neither_lost_nor_made() -> None:
    grey = drawn(round_spots((100.3, 200.7)), round_spots())
    assert grey.sum() * 2 == pytest.approx(190 * np.pi * 2.8**2, rel=2e-3)


@pytest.mark.parametrize("parity", [0, 1])
@pytest.mark.parametrize("integration", [True, False])
@pytest.mark.parametrize("place", [(100.0, 200.0), (57.31, 301.83), (200.5, 99.27)])
def test_the_centroid_is_the_centre(place: tuple[float, float], parity: int, integration: bool) -> None:
    grey = drawn(round_spots(place), round_spots(), parity, field_integration=integration)
    assert_allclose(centroid(grey, parity), place, atol=4e-3 if integration else 0.02)


def test_an_inclined_ellipse_has_its_second_moments() -> None:
    spot = Ellipses(np.array([[150.2, 250.4]]), np.array([[4.0, 3.0]]), np.array([[-1.0, 2.0]]), np.ones(1))
    grey = drawn(spot, round_spots(), spread_x_px=0.7, spread_y_px=1.0)
    rows, columns = np.mgrid[:288, :720]
    x, y = columns - 150.2, 2 * rows - 250.4
    found = [(grey * product).sum() / grey.sum() for product in (x * x, y * y, x * y)]
    pixel, lines = 1 / 12, 4 / 12
    wanted = [17 / 4 + 0.49 + pixel, 13 / 4 + 1.0 + lines, 10 / 4]
    assert_allclose(found, wanted, rtol=0.01)


@pytest.mark.parametrize(("key", "axis"), [("spread_x_px", 0), ("spread_y_px", 1)])
def test_spreads_along_and_across_the_lines_are_separate(key: str, axis: int) -> None:
    rows, columns = np.mgrid[:288, :720]
    squares = ((columns - 100.0) ** 2, (2 * rows - 200.0) ** 2)

    def widths(**picture: Any) -> list[float]:
        grey = drawn(round_spots((100.0, 200.0)), round_spots(), **picture)
        return [float((grey * square).sum() / grey.sum()) for square in squares]

    narrow, wide = widths(), widths(**{key: 1.6})
    assert wide[axis] - narrow[axis] == pytest.approx(1.6**2 - 0.8**2, rel=0.03)
    assert wide[1 - axis] == pytest.approx(narrow[1 - axis], rel=0.005)


def test_each_view_is_clipped_to_its_half() -> None:
    grey = drawn(round_spots((359.5, 200.0)), round_spots((359.5, 300.0)))
    assert grey[95:106, 360:].max() == 0
    assert grey[95:106, 355:360].max() > 100
    assert grey[145:156, :360].max() == 0
    assert grey[145:156, 360:365].max() > 100


@pytest.mark.parametrize("place", [(0.0, 0.0), (1.0, 575.0), (-2.0, 300.0), (150.0, -1.5), (150.0, 577.0)])
def test_a_target_at_the_pictures_edge_is_cut_off_there(place: tuple[float, float]) -> None:
    whole = drawn(round_spots((150.0 + place[0] % 1, 200.0 + place[1] % 2)), round_spots())
    cut = drawn(round_spots(place), round_spots())
    assert 0 < cut.sum() < whole.sum()


@pytest.mark.parametrize(
    "place", [(-60.0, 200.0), (150.0, -70.0), (150.0, 5000.0), (np.nan, np.nan), (900.0, 100.0)]
)
def test_what_is_out_of_sight_is_not_drawn(place: tuple[float, float]) -> None:
    assert drawn(round_spots(place), round_spots()).max() == 0
    assert drawn(round_spots(place, (100.0, 100.0)), round_spots()).max() > 100


def test_a_huge_disc_that_fits_nowhere_does_no_harm() -> None:
    huge, usual = round_spots((100.0, 100.0), radius=300.0), round_spots((500.0, 100.0))
    assert drawn(huge, round_spots()).max() == 0
    assert_allclose(drawn(huge, usual), drawn(round_spots(), usual), atol=0)


def test_overlapping_targets_add_up() -> None:
    together = drawn(round_spots((100.0, 200.0), (104.0, 200.0)), round_spots())
    apart = [drawn(round_spots((x, 200.0)), round_spots()) for x in (100.0, 104.0)]
    assert_allclose(together, apart[0] + apart[1], atol=0.05)


def test_line_jitter_shifts_every_row_of_both_halves_by_the_same() -> None:
    shift = np.random.default_rng(2).normal(0, 0.2, 288)
    spots = round_spots((100.4, 200.3), radius=6.0), round_spots((500.7, 200.3), radius=6.0)
    still, shaken = drawn(*spots), drawn(*spots, shift=shift)
    columns = np.arange(360)
    for half in (slice(0, 360), slice(360, 720)):
        rows = slice(98, 103)
        before, after = (
            (grey[rows, half] * columns).sum(axis=1) / grey[rows, half].sum(axis=1)
            for grey in (still, shaken)
        )
        assert_allclose(after - before, shift[rows], atol=2e-3)


def test_a_shifted_row_is_the_row_of_a_shifted_target() -> None:
    shaken = drawn(round_spots((100.4, 200.3)), round_spots(), shift=np.full(288, 0.3))
    moved = drawn(round_spots((100.7, 200.3)), round_spots())
    assert_allclose(shaken, moved, atol=190 * 0.012)


def supersampled(view: View, targets: Targets, parity: int, picture: PictureOptions, corner: Array) -> Array:
    """(16, 28) grey values of a piece of the field, from the boundary of one disc through the optics."""
    angle = np.linspace(0, 2 * np.pi, 2000, endpoint=False)
    normal = targets.normal[0]
    first = np.cross(normal, [0.0, 1.0, 0.0])
    first /= np.linalg.norm(first)
    circle = np.multiply.outer(np.cos(angle), first) + np.multiply.outer(
        np.sin(angle), np.cross(normal, first)
    )
    outline = view.image(targets.xyz_mm + 0.75 * circle) - corner
    x = _covered(outline, np.arange(-0.5 + 0.5 / FINE, 31.5, 1 / FINE))
    spread = cv2.GaussianBlur(
        x,
        (0, 0),
        picture.spread_x_px * FINE,
        None,
        picture.spread_y_px * FINE,
        borderType=cv2.BORDER_CONSTANT,
    )
    pixels = spread.reshape(len(spread), 28, FINE).mean(axis=2)
    lines = 2 if picture.field_integration else 1
    starts = (np.arange(1, 15) * 2 + parity + 0.5 - lines / 2) * FINE
    return np.stack([pixels[int(s) : int(s) + lines * FINE].mean(axis=0) for s in starts]) * picture.contrast


def _covered(outline: Array, y: Array) -> NDArray[np.float64]:
    """(len(y), 28 · FINE) share of each fine cell inside a convex outline, exact along x."""
    at = np.argsort(outline[:, 1])
    low, high = at[0], at[-1]
    way = np.roll(outline, -low, axis=0)
    turn = (high - low) % len(outline)
    sides = way[: turn + 1], np.vstack([way[turn:], way[:1]])[::-1]
    edges = np.sort([np.interp(y, s[:, 1], s[:, 0], left=np.nan, right=np.nan) for s in sides], axis=0)
    cells = np.arange(28 * FINE) / FINE - 0.5
    inside = np.clip((edges[1][:, None] - cells) * FINE, 0, 1) - np.clip(
        (edges[0][:, None] - cells) * FINE, 0, 1
    )
    return np.nan_to_num(inside)


@pytest.mark.parametrize("reflections", [1, 2])
@pytest.mark.parametrize("integration", [True, False])
@pytest.mark.parametrize("half", [0, 1])
def test_the_picture_agrees_with_a_supersampled_one_through_the_same_optics(
    world: Callable[..., World], half: int, integration: bool, reflections: int
) -> None:
    rng = np.random.default_rng(11)
    picture: dict[str, Any] = {"spread_x_px": 0.9, "spread_y_px": 0.7, "field_integration": integration}
    for parity in (0, 1):
        made = world(picture, scene="points", rig={"reflections": reflections})
        normal = rng.normal(0, 0.35, (1, 3)) + np.array([0, 0, 1])
        targets = Targets(rng.uniform(-15, 15, (1, 3)), normal / np.linalg.norm(normal))
        view, options = made.views[half], PictureOptions(**picture)
        place = view.image(targets.xyz_mm)[0]
        corner = np.array([np.floor(place[0]) - 14, 2 * np.floor(place[1] / 2) - 16])
        wanted = supersampled(view, targets, parity, options, corner)
        images = [round_spots(), round_spots()]
        images[half] = disc_images(view, targets, 1.5)
        grey = Renderer(options).draw((images[0], images[1]), parity, QUIET).reshape(288, 720) / SCALE
        row, column = int(corner[1] // 2) + 1, int(corner[0])
        found = grey[row : row + 14, column : column + 28]
        assert found.sum() == pytest.approx(grey.sum(), rel=1e-3)
        assert np.abs(found - wanted).max() < 0.01 * options.contrast
        assert_allclose(centroid(found), centroid(wanted), atol=0.005)
