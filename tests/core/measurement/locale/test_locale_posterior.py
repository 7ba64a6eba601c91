"""Looked up for all blobs at once, as if every row of every blob had been looked up by itself."""

import numpy as np
import pytest

from core.measurement.rendering import grid_of_discs
from grabberd.core.field import double_lines, quantise
from grabberd.core.measurement import LocationSettings
from grabberd.core.measurement.labelling import by_component, find_runs, shapes_of, target_bits
from grabberd.core.measurement.locale import Entries, Posterior, likelihoods, patterns_of
from grabberd.core.measurement.locale_table import Appearance, moments, table
from grabberd.core.measurement.locators.locator import Seen

LOOK = Appearance(1.0, 1.0, 0.3, 0.05, 0.8, 0.12, 2)


@pytest.fixture(scope="module", params=[False, True], ids=["288 lines", "doubled"])
def looked_up(request):
    """Patterns of discs of several sizes, their tables, and their entries."""
    fields = [grid_of_discs(np.random.default_rng(6), diameter_px=size)[0] for size in (4.5, 6.5)]
    luma = np.concatenate([field.luma[: field.rows // 2] for field in fields])
    field = double_lines(type(fields[0])(luma, fields[0].parity, fields[0].y0, 2)) if request.param else None
    packed = quantise(field or type(fields[0])(luma, fields[0].parity, fields[0].y0, 2), 1, 80)
    components = by_component(find_runs(target_bits(packed)))
    seen = Seen(packed, *components[:2], shapes_of(*components), LocationSettings())
    patterns = patterns_of(seen, seen.centroids)
    look = LOOK._replace(y_step=packed.y_step)
    tables = [table(look.of_size(*kind)) for kind in patterns.kinds]
    return patterns, tables, packed.y_step


def plainly(patterns, tables):
    """(M, G) blob by blob and row by row, with eight bytes a number."""
    cuts, found, blob = patterns.cuts, [], 0
    bounds = [*cuts.first.tolist(), len(cuts.row)]
    for (windows, grid), count in zip(tables, patterns.blobs, strict=True):
        for own in range(blob, blob + count):
            rows = range(bounds[own], bounds[own + 1])
            entries = [
                grid.entry_of_cut(part, cuts.interpolated[r], x[r], grid.row_of(cuts.row[r]))
                for r in rows
                for part, x in enumerate((cuts.start, cuts.end))
            ] + [
                grid.entry_of_cap(part, cuts.interpolated[r], cuts.phase[own], grid.row_of(cuts.row[r]))
                for part, r in enumerate((rows[0], rows[-1]))
            ]
            found.append(sum(windows[int(one)].astype(np.float64) for one in entries).ravel())
        blob += count
    return np.array(found)


def entries_of(patterns, tables):
    return Entries.of(patterns.cuts, [one.grid for one in tables], patterns.blobs)


def test_likelihoods_are_the_sums_over_each_blob_s_rows(looked_up):
    patterns, tables, _ = looked_up
    assert len(patterns.kinds) > 1
    found = likelihoods(tables, patterns.blobs, entries_of(patterns, tables))
    np.testing.assert_allclose(found, plainly(patterns, tables), rtol=1e-5, atol=1e-5)


def test_single_precision_moves_no_place_by_a_ten_thousandth_of_a_pixel(looked_up):
    patterns, tables, y_step = looked_up
    found = Posterior.of(likelihoods(tables, patterns.blobs, entries_of(patterns, tables)), y_step)
    exact = plainly(patterns, tables)
    weight = np.exp(exact - exact.max(axis=1, keepdims=True))
    places = moments(y_step)[:, 1:3].astype(np.float64)
    mean = weight @ places / weight.sum(axis=1, keepdims=True)
    np.testing.assert_allclose(found.from_middle_px, mean, atol=1e-5)


def test_the_first_blobs_can_be_looked_up_alone(looked_up):
    patterns, tables, _ = looked_up
    entries = entries_of(patterns, tables)
    blobs = patterns.blobs[0] - 1
    alone = likelihoods(tables[:1], [blobs], entries.first(blobs))
    every = likelihoods(tables, patterns.blobs, entries)
    np.testing.assert_array_equal(alone, every[:blobs])


def test_a_grid_has_room_for_all_its_entries(looked_up):
    _, tables, _ = looked_up
    for windows, grid in tables:
        assert grid.empty == len(windows) - 1
        assert not windows[grid.empty].any()
