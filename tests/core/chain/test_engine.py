"""The engine gives the points that numpy gives step by step, whatever the fields show."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from core.chain.fake_scene import take_scene
from core.reconstruction.many import grid
from grabberd.core.calibration.adjustment.adjustment import adjust
from grabberd.core.calibration.adjustment.network import Network, Unknowns
from grabberd.core.chain import measure as process
from grabberd.core.chain.engine import MOST_FIELDS, Engine
from grabberd.core.chain.locating import Locating
from grabberd.core.chain.measure import measure_fields
from grabberd.core.field import PackedField
from grabberd.core.geometry import LocalField, Rig, rays
from grabberd.core.kernel import KERNEL
from grabberd.core.measurement import LocationSettings, location
from grabberd.core.reconstruction import CoverageTally, ImageNoise, Tracker, tracking
from grabberd.core.reconstruction.correspondence import compiled_search
from grabberd.core.reconstruction.correspondence.correspondence import Correspondence

pytestmark = pytest.mark.skipif(
    not KERNEL,
    reason="THERE IS NO COMPILED KERNEL HERE: nothing shows that it equals numpy (see docs/decisions)",
)

FIELDS = 70
WAYS = [(1, "doubled"), (1, "field"), (8, "field"), (4, "field"), (1, "progressive"), (8, "progressive")]
ROUNDED_PX = 1e-5
"""numpy adds log likelihoods as single precision numbers, in another order; so it does with fitted discs."""


@pytest.fixture(scope="module")
def liner():
    """The pulsating liner before the default rig, with identification again in its fast closures."""
    return take_scene(FIELDS, scene="ellipse")


def with_local_fields(setup):
    rng = np.random.default_rng(5)
    shift, sigma = rng.normal(0, 0.1, (41, 50, 2)), rng.uniform(0.01, 0.1, (41, 50, 2))
    bumpy = LocalField.through((-0.5, -0.5), 15.0, shift, sigma)
    return replace(setup, calibration=replace(setup.calibration, local_fields=(bumpy, None)))


def by_numpy(fields, setup, monkeypatch):
    with monkeypatch.context() as patched:
        patched.setattr(process, "KERNEL", None)
        patched.setattr(location, "KERNEL", None)
        patched.setattr(tracking, "Correspondence", partial(Correspondence, kernel=None))
        return list(measure_fields(fields, setup))


def assert_same(ours, theirs):
    """The same targets, and their points to what rounding does to their images."""
    assert [one.n for one in ours] == [one.n for one in theirs]
    for one, other in zip(ours, theirs, strict=True):
        assert len(one.blobs) == len(other.blobs)
        assert np.allclose(one.blobs.xy_px, other.blobs.xy_px, rtol=0, atol=ROUNDED_PX)
        assert np.array_equal(one.points.target, other.points.target)
        for name in ("xyz_mm", "image_px", "residual_px"):
            assert np.allclose(
                getattr(one.points, name), getattr(other.points, name), rtol=0, atol=ROUNDED_PX
            )
        for name in ("covariance_mm2", "calibration_covariance_mm2"):
            assert np.allclose(getattr(one.points, name), getattr(other.points, name), rtol=1e-3, atol=1e-7)


def bytes_of(measured):
    return [(one.n, *(getattr(one.points, name).tobytes() for name in NAMES)) for one in measured]


NAMES = ("target", "xyz_mm", "covariance_mm2", "calibration_covariance_mm2", "image_px", "residual_px")


@pytest.mark.parametrize("local", [False, True], ids=["plain", "with local fields"])
@pytest.mark.parametrize("way", WAYS)
def test_the_points_are_numpys(liner, way, local, monkeypatch):
    setup = with_local_fields(liner.setup) if local else liner.setup
    fields = list(liner.packed(*way))
    ours = list(measure_fields(fields, setup))
    assert_same(ours, by_numpy(fields, setup, monkeypatch))
    assert sum(len(one.points) for one in ours) > 60 * FIELDS


@pytest.mark.parametrize("way", [*WAYS[:3], *WAYS[4:]])
def test_fields_taken_together_give_the_same_bits(liner, way):
    fields = list(liner.packed(*way))
    alone = bytes_of(measure_fields(fields, liner.setup))
    for ahead in (2, 25, MOST_FIELDS + 3):
        assert bytes_of(measure_fields(fields, liner.setup, ahead=ahead)) == alone


@pytest.mark.parametrize("bits", [1, 8])
def test_doubled_fields_and_progressive_pictures_of_one_size_keep_their_own_settings(liner, bits):
    """As where one replay follows another: neither has the tables or the line shifts of the other."""
    doubled, whole = (list(liner.packed(bits, lines))[:10] for lines in ("doubled", "progressive"))
    both = [*doubled, *whole, *doubled]
    alone = [bytes_of(measure_fields(one, liner.setup)) for one in (doubled, whole, doubled)]
    assert bytes_of(measure_fields(both, liner.setup, ahead=len(both))) == [
        one for own in alone for one in own
    ]


@pytest.mark.parametrize("bits", [1, 8])
def test_progressive_pictures_are_taken_many_in_one_call(liner, bits):
    """No jitter is estimated in them, for which grey fields are taken one by one now and then."""
    first = next(liner.packed(bits, "progressive")).packed
    assert Locating(LocationSettings(), 0.12).alike(first) > MOST_FIELDS


def test_who_was_found_is_counted_alike(liner, monkeypatch):
    def coverage():
        tally = CoverageTally(liner.setup.calibration, liner.setup.object_model)
        for _ in measure_fields(liner.packed(1, "doubled"), liner.setup, tally):
            pass
        return tally.result()

    ours = coverage()
    monkeypatch.setattr(process, "KERNEL", None)
    theirs = coverage()
    assert np.array_equal(ours.misses, theirs.misses)
    assert np.array_equal(ours.field_expected, theirs.field_expected)
    assert np.allclose(ours.offset_mm, theirs.offset_mm, atol=1e-9, equal_nan=True)


def tracker_of(setup, model=None):
    rig, model = Rig.of(setup.calibration), model or setup.object_model
    return Tracker(rig, model, ImageNoise.of(rig, model, setup.line_jitter_px, 1), setup.tracking)


def steps(engine, fields, settings):
    """Points of fields 20 ms apart."""
    for way in engine.run(fields, [0.02] * len(fields), settings):
        yield way.points.xyz_mm.tobytes()


def test_a_track_that_is_kept_goes_on_as_if_nothing_had_been(liner):
    fields = [one.packed for one in liner.packed(1, "doubled")]
    settings, views = LocationSettings(), liner.setup.calibration.views
    one, first = (Engine(KERNEL, tracker_of(liner.setup), views) for _ in range(2))
    whole = list(steps(one, fields, settings))
    begun = list(steps(first, fields[:31], settings))
    second = Engine(KERNEL, tracker_of(liner.setup), views)
    second.track = first.track.copy()
    assert begun + list(steps(second, fields[31:], settings)) == whole
    assert np.array_equal(second.track, one.track)


def strange(packed, kind):
    rng = np.random.default_rng(3)
    data = np.zeros_like(packed.data)
    if kind == "full":
        data[:] = 255
    elif kind == "noise":
        data = rng.integers(0, 256, data.shape, np.uint8)
    elif kind == "chequered":
        data[:, ::2], data[:, 1::2] = 0xAA, 0x55
    elif kind == "one pixel":
        data[0, 100, 20] = 16
    elif kind == "thousands of blobs":
        data[:, 2::8, ::2] = data[:, 3::8, ::2] = data[:, 4::8, ::2] = 0x7C
    return replace(packed, data=data)


@pytest.mark.parametrize("kind", ["empty", "full", "noise", "chequered", "one pixel", "thousands of blobs"])
@pytest.mark.parametrize("lines", ["doubled", "field"])
def test_a_strange_field_among_others_gives_what_the_steps_give(liner, kind, lines, monkeypatch):
    setup = replace(liner.setup, location=LocationSettings(max_diameter_px=9.0))
    fields = list(liner.packed(1, lines))[:16]
    for n in (6, 11, 12):
        fields[n] = fields[n]._replace(packed=strange(fields[n].packed, kind))
    ours = list(measure_fields(fields, setup, ahead=25))
    with monkeypatch.context() as patched:
        patched.setattr(process, "KERNEL", None)
        theirs = list(measure_fields(fields, setup))
    assert_same(ours, theirs)
    assert min(len(ours[n].points) for n in (5, 7, 10, 13)) > 60


@pytest.mark.parametrize("gap_s", [0.04, 0.06, 0.1, 1.0, np.inf])
def test_after_a_gap_the_track_is_the_trackers(liner, gap_s):
    """Followed over a short one, identified anew after a longer one, lost where there is nothing."""
    fields = [one.packed for one in liner.packed(1, "doubled")][10:22]
    fields[7] = strange(fields[7], "empty")
    passed_s = [np.inf, 0.02, 0.02, gap_s, 0.02, 0.02, gap_s, 0.02, 0.02, gap_s, gap_s, 0.02]
    tracker = tracker_of(liner.setup)
    engine, track = Engine(KERNEL, tracker, liner.setup.calibration.views), tracker.start()
    counts = []
    for way, own_s in zip(engine.run(fields, passed_s, LocationSettings()), passed_s, strict=True):
        track, points = tracker.step(track, *way.halves, own_s)
        assert np.array_equal(points.target, way.points.target)
        assert np.allclose(points.xyz_mm, way.points.xyz_mm, rtol=0, atol=1e-9)
        assert np.allclose(track.numbers, way.track_numbers, rtol=1e-6, atol=1e-7)
        assert (track.sighting is None) == (way.track.sighting is None)
        counts.append(len(points))
    assert not counts[7]
    assert min(counts[:7] + counts[8:]) > 60


def disturbed(packed, rng):
    """A field with a band hidden, with strange blobs, with nothing, or as it was."""
    bits = np.unpackbits(packed.data[0], axis=1)
    match rng.choice(["as it was", "columns", "rows", "blobs", "nothing"], p=[0.35, 0.2, 0.2, 0.2, 0.05]):
        case "columns":
            bits[:, int(rng.integers(0, 700)) :][:, : int(rng.integers(20, 300))] = 0
        case "rows":
            bits[int(rng.integers(0, 500)) :][: int(rng.integers(20, 300))] = 0
        case "blobs":
            for row, column in rng.integers(0, (570, 710), (60, 2)):
                bits[row : row + 5, column : column + 5] = 1
        case "nothing":
            bits[:] = 0
    return replace(packed, data=np.packbits(bits, axis=1)[np.newaxis])


def assert_same_sighting(ours, theirs):
    assert np.array_equal(ours.target, theirs.target)
    assert np.array_equal(ours.left, theirs.left)
    assert np.array_equal(ours.right, theirs.right)
    assert np.array_equal(ours.misses, theirs.misses)
    assert np.allclose(ours.predicted_px, theirs.predicted_px, atol=1e-5, equal_nan=True)
    assert np.allclose(ours.expected.sigma_mm, theirs.expected.sigma_mm, atol=1e-6)


@pytest.mark.parametrize("seed", range(6))
def test_whatever_is_hidden_added_or_skipped_the_track_is_numpys(liner, seed, monkeypatch):
    rng = np.random.default_rng(seed)
    fields = [one.packed for one in liner.packed(1, "doubled")]
    with monkeypatch.context() as patched:
        patched.setattr(tracking, "Correspondence", partial(Correspondence, kernel=None))
        by_steps = tracker_of(liner.setup)
    engine, track = Engine(KERNEL, tracker_of(liner.setup), liner.setup.calibration.views), by_steps.start()
    place, counts = int(rng.integers(FIELDS)), []
    for step in range(25):
        place = (place + int(rng.choice([1, 1, 1, 2, 3, 7]))) % FIELDS
        passed_s = float(rng.choice([0.02, 0.02, 0.02, 0.04, 0.06, 0.1, np.inf])) if step else np.inf
        (way,) = engine.run([disturbed(fields[place], rng)], [passed_s], LocationSettings())
        track, points = by_steps.step(track, *way.halves, passed_s)
        assert np.array_equal(points.target, way.points.target)
        assert np.allclose(points.xyz_mm, way.points.xyz_mm, rtol=0, atol=1e-6)
        assert np.allclose(track.numbers, way.track_numbers, rtol=1e-4, atol=1e-5)
        assert (track.sighting is None) == (way.misses is None)
        if track.sighting is not None:
            assert_same_sighting(way.track.sighting, track.sighting)
        counts.append(len(points))
    assert np.median(counts) > 40


@pytest.mark.parametrize("room", [2, 3])
def test_predictors_that_give_way_to_others_change_no_bit(liner, room, monkeypatch):
    fields = [one.packed for one in liner.packed(1, "doubled")]
    views = liner.setup.calibration.views
    whole = list(steps(Engine(KERNEL, tracker_of(liner.setup), views), fields, LocationSettings()))
    monkeypatch.setattr(compiled_search, "MOST_PREDICTORS", room)
    few = list(steps(Engine(KERNEL, tracker_of(liner.setup), views), fields, LocationSettings()))
    assert few == whole


def test_an_object_whose_field_is_made_by_parts_is_not_covered(liner):
    views = liner.setup.calibration.views
    assert Engine.of(KERNEL, tracker_of(liner.setup, grid(600)), views) is None
    assert Engine.of(None, tracker_of(liner.setup), views) is None
    assert Engine.of(KERNEL, tracker_of(liner.setup), views)


@pytest.mark.parametrize(
    ("bits", "settings", "covered"),
    [
        (1, LocationSettings(), True),
        (1, LocationSettings(line_shifts=True), True),
        (1, LocationSettings("vernier"), False),
        (8, LocationSettings(), True),
        (8, LocationSettings("weighted"), False),
    ],
)
def test_methods_that_numpy_alone_has_are_not_covered(bits, settings, covered):
    shape = (1, 8, 8) if bits == 8 else (bits, 8, 1)
    assert Engine.takes(PackedField(np.zeros(shape, np.uint8), bits, 8, 0, 0, 2, 60), settings) == covered


def as_corrections(setup):
    """The same rig, its polynomials fitted again as corrections; all but .01 px of its pictures."""
    known = setup.calibration
    views = []
    for view in known.views:
        columns, lines = np.meshgrid(np.arange(view.first_column, view.end_column, 20), np.arange(0, 576, 20))
        xy_px = np.column_stack([columns.ravel(), lines.ravel()]).astype(np.float64)
        center, directions = rays(view, xy_px)
        places = np.concatenate([center + away * directions for away in (230.0, 250.0)])
        start = replace(view, polynomial="correction", b=tuple(-value for value in view.b))
        both = np.concatenate([xy_px, xy_px])
        network = Network(
            (start,),
            np.zeros(len(both), np.intp),
            np.arange(len(both)),
            both,
            np.full(both.shape, 0.01),
            places,
            np.zeros(places.shape),
        )
        fitted = adjust(network, Unknowns.of([start], [f"b{number}" for number in range(1, 10)]))
        assert np.abs(fitted.residual_px).max() < 0.01
        views += fitted.views
    left, right = views
    return replace(setup, calibration=replace(known, left=left, right=right))


def test_a_rig_whose_polynomials_are_corrections_is_measured_by_numpy(liner):
    few, setup = list(liner.packed(8, "field"))[:8], as_corrections(liner.setup)
    judges = Correspondence(Rig.of(setup.calibration), setup.object_model, ImageNoise(0.1, 2, 2.0))
    assert judges.identification is None
    for one, other in zip(measure_fields(few, setup), measure_fields(few, liner.setup), strict=True):
        assert np.array_equal(one.points.target, other.points.target)
        assert np.abs(one.points.xyz_mm - other.points.xyz_mm).max() < 0.01
