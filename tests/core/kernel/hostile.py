"""Run under sanitisers: pictures and blobs as a fault or an enemy may make them, into the kernel."""

from dataclasses import replace

import numpy as np

from core.geometry.rigs import calibration
from core.kernel.layouts import LAYOUTS
from core.reconstruction.liners import model
from core.reconstruction.many import grid
from grabberd.core.chain.engine import Engine
from grabberd.core.field import BIT_DEPTHS, INTERPOLATIONS, Field, PackedField, Packing, pack
from grabberd.core.geometry import LocalField, Rig, project
from grabberd.core.kernel import load
from grabberd.core.measurement import LocationSettings
from grabberd.core.measurement.location import measure_compiled, measure_grey, takes_grey
from grabberd.core.measurement.locators.locator import GREY
from grabberd.core.reconstruction import ImageNoise, Track, Tracker, ViewBlobs
from grabberd.core.reconstruction.correspondence.agreement import Hypotheses
from grabberd.core.reconstruction.correspondence.compiled_search import Identification
from grabberd.core.reconstruction.correspondence.correspondence import Correspondence
from grabberd.core.reconstruction.correspondence.displacement_field import DisplacementField
from grabberd.instrument.acquisition import ContentCheck, GrabbedField

KERNEL = load("_sanitised")
assert KERNEL


def bits(rng, rows, stride, kind):
    picture = rng.integers(0, 256, (1, rows, stride), np.uint8)
    if kind == "full":
        picture[:] = 255
    elif kind == "comb":
        picture[:] = 0xAA
    elif kind == "sparse":
        picture &= rng.integers(0, 256, picture.shape, np.uint8) & rng.integers(
            0, 256, picture.shape, np.uint8
        )
        picture &= rng.integers(0, 256, picture.shape, np.uint8)
    return picture


def pictures(rng):
    for kind in ("noise", "full", "comb", "sparse"):
        for rows, stride in ((1, 1), (2, 3), (9, 8), (31, 17), (64, 90)):
            for y_step in (1, 2):
                yield PackedField(
                    bits(rng, rows, stride, kind), 1, 8 * stride, int(rng.integers(2)), 0, y_step, 60
                )


def grey_pictures(rng):
    """Noise, black, white and a little of each, of every bit depth, in sizes that no vector fits."""
    for bits in GREY:
        for rows, stride in ((1, 1), (2, 3), (9, 8), (31, 67), (64, 130)):
            for y_step in (1, 2):
                shape = (1, rows, stride) if bits == 8 else (bits, rows, stride)
                data = rng.integers(0, 256, shape, np.uint8)
                data[rng.random(shape) < rng.choice([0.0, 0.5, 0.95])] = rng.choice([0, 255])
                columns = stride if bits == 8 else 8 * stride - int(rng.integers(8))
                threshold = int(rng.choice([-5, 0, 60, 254, 255, 999]))
                parity = int(rng.integers(3 if y_step == 1 else 2))
                yield PackedField(data, bits, columns, parity, 0, y_step, threshold)


def grey_settings(rng):
    for how in ({}, {"line_shifts": False}, {"line_jitter_known": True}, {"line_jitter_px": 0.0}):
        noise = rng.choice([None, 1e-9, 1e9])
        yield LocationSettings("template", 0.0, float(rng.choice([4.0, 1e3])), noise_levels=noise, **how)


def wild_blobs(rng, count):
    scale = 10.0 ** rng.uniform(0, 6)
    xy = rng.normal(360, scale, (count, 2))
    common = rng.uniform(0, 1, count) if count % 2 else None
    return ViewBlobs(xy, 10.0 ** rng.uniform(-12, 6, (count, 2)), common, float(count % 7))


def main():
    rng = np.random.default_rng(8)
    locate(rng)
    for size in ((1, 1), (2, 3), (9, 8), (31, 67), (64, 130)):
        take_in(rng, size)
    for one in (model(), grid(520)):
        look_for(rng, one)
    follow(rng, model())
    for count in (0, 1, 7):
        bend(rng, count)
    print("no harm")


def locate(rng):
    for number, packed in enumerate(pictures(rng)):
        # Tables for locales of every size take numpy's time; their number is kept small.
        for method, greatest_px in (
            (("centroid", 1e3), ("locale", 7.0)) if number % 3 == 0 else (("centroid", 9.0),)
        ):
            measure_compiled(KERNEL, packed, LocationSettings(method, 0.0, greatest_px))
    for packed in grey_pictures(rng):
        for wanted in grey_settings(rng):
            if takes_grey(packed, wanted):
                measure_grey(KERNEL, packed, wanted)


def take_in(rng, size):
    """A stream of noise that comes again, in rows of every layout, with buffers that end where it ends."""
    fields = [rng.integers(0, rng.choice([2, 256]), size, np.uint8) for _ in range(3)]
    for layout in LAYOUTS:
        check = ContentCheck(KERNEL)
        for n, bits in enumerate(2 * BIT_DEPTHS):
            luma = layout(np.roll(fields[n % 3], rng.integers(0, 2), axis=1))
            doubled = bool(n % 3) and size[0] > 1
            shape = (size[0] * (1 + doubled), size[1])
            by_pixel = rng.integers(0, 256, shape, np.uint8) if n % 2 else None
            packing = Packing(bits, doubled, int(rng.choice([-5, 60, 999])), by_pixel, INTERPOLATIONS[n % 2])
            grabbed = GrabbedField(Field.intact(luma, n % 2), n * 20_000_000, n, None)
            check.take(grabbed, packing)
            pack(grabbed.field, packing, KERNEL)


def bend(rng, count):
    """Walls that may be anything, in buffers with no room to spare."""
    for scale in (1e-300, 1.0, 1e300, np.nan):
        values, rest = scale * rng.normal(size=(5, count, 4)), rng.normal(size=(7, count))
        contact, stiffness = rng.normal(size=count), np.empty((count, 24, 24))
        KERNEL.wall_forces(values, rest, 1.0, np.empty((count, 6, 4)), np.empty((count, 6, 4, 4)))
        KERNEL.wall_stiffness(values, rest, 1.0, 0.03, contact, stiffness)


def look_for(rng, liner):
    """Its targets, among blobs that may be anywhere."""
    known = Rig.of(calibration(covariance=np.eye(36) * 1e-8))
    correspondence = Correspondence(known, liner, ImageNoise.of(known, liner, 0.12, 2), kernel=KERNEL)
    with np.errstate(all="ignore"):
        for count in (0, 1, 2, 50, 400):
            for reach_mm in (0.0, 1.0, 1e3, 1e9, np.inf):
                places = liner.xyz_mm + rng.normal(
                    0, reach_mm if reach_mm < 1e4 else 500.0, liner.xyz_mm.shape
                )
                sigma = np.full(len(liner), reach_mm)
                correspondence.near(places, sigma, wild_blobs(rng, count), wild_blobs(rng, count + 1))
        if isinstance(correspondence.agreement.field, DisplacementField):
            identify(rng, known, correspondence)


def follow(rng, liner):
    """Its targets, through fields that show anything, from tracks that may be anything."""
    shift, sigma = rng.normal(0, 9, (41, 50, 2)), rng.uniform(0, 9, (41, 50, 2))
    local = LocalField.through((-0.5, -0.5), 15.0, shift, sigma)
    made = replace(calibration(covariance=np.eye(36) * 1e-8), local_fields=(local, None))
    known = Rig.of(made)
    tracker = Tracker(known, liner, ImageNoise.of(known, liner, 0.12, 2))
    seen = {True: list(pictures(rng)), False: list(grey_pictures(rng))}
    with np.errstate(all="ignore"):
        for scale in (0.0, 1e-3, 1.0, 1e3, 1e300, np.nan):
            engine = Engine(KERNEL, tracker, made.views)
            for one in [*seen[True], *seen[False]]:
                settings = LocationSettings("centroid" if one.bits == 1 else "template", 0.0, 1e3)
                if engine.takes(one, settings):
                    engine.track = wild_track(rng, liner, scale)
                    passed_s = [0.02, float(rng.choice([0.0, 0.02, -1.0, np.inf, np.nan])), 0.02]
                    list(engine.run([one] * 3, passed_s, settings))
        track_blobs(rng, tracker, made)


def wild_track(rng, liner, scale):
    start = Track.start(liner)
    return replace(
        start,
        xyz_mm=liner.xyz_mm + scale * rng.normal(size=liner.xyz_mm.shape),
        sigma_mm=scale * rng.random(len(liner)),
        velocity_mm_s=scale * rng.normal(size=liner.xyz_mm.shape),
        speed_sigma_mm_s=float(scale),
        unseen_s=rng.choice([0.0, 0.02, np.inf], len(liner)),
        age_s=0.0,
        found=int(rng.integers(0, 60)),
    ).numbers


def track_blobs(rng, tracker, made):
    """Discs where its targets are, so that they are found, lost and contradicted."""
    engine = Engine(KERNEL, tracker, made.views)
    for _ in range(12):
        bits = np.zeros((288, 720), np.uint8)
        for view in tracker.rig.views:
            for x, y in np.nan_to_num(project(view, tracker.model.xyz_mm)) + rng.normal(0, 0.4, 2):
                row, column = int(np.clip(y / 2, 2, 284)), int(np.clip(x, 4, 714))
                if rng.random() < 0.9:
                    bits[row - 1 : row + 2, column - 2 : column + 3] = 1
        packed = PackedField(np.packbits(bits, axis=1)[np.newaxis], 1, 720, 0, 0, 2, 60)
        engine.track = wild_track(rng, tracker.model, 0.3)
        for way in engine.run([packed] * 2, [0.02] * 2, LocationSettings("centroid")):
            if way.track.sighting:
                assert len(way.track.sighting) >= len(way.points) > 0


def identify(rng, known, correspondence):
    """Its targets, among such blobs again, and from hypotheses that no blobs can have."""
    by_kernel = Identification(KERNEL, known, correspondence.agreement, correspondence.noise)
    for count in (0, 1, 2, 50):
        for _ in range(5):
            correspondence.identify(wild_blobs(rng, count), wild_blobs(rng, count + 1))
    targets = len(correspondence.model)
    for count in (0, 1, 2, 300):
        for scale in (0.0, 1e-300, 1.0, 1e200, np.inf, np.nan):
            target, left, right = np.sort(rng.integers(0, targets, count)), *rng.integers(0, 90, (2, count))
            apart_mm, variance_mm2 = scale * rng.normal(size=(count, 3)), scale * rng.random((count, 3))
            by_kernel.largest(Hypotheses(target, left, right, apart_mm, variance_mm2), 90, 90)


main()
