"""The compiled kernel never reads or writes where it must not, whatever it is given."""

import ctypes
import sys
from types import ModuleType

import numpy as np
import pytest

from core.kernel.sanitised import HERE, build, run, runtime
from grabberd.core.chain.engine import Following
from grabberd.core.kernel import DONE, KERNEL, REFUSED, load
from grabberd.core.measurement.location import GreySettings, Settings
from grabberd.core.reconstruction import Smoothness
from grabberd.core.reconstruction.correspondence.compiled_search import Identifying, Predictors, World
from grabberd.core.reconstruction.correspondence.displacement_field import DisplacementField

needs_kernel = pytest.mark.skipif(not KERNEL, reason="THERE IS NO COMPILED KERNEL HERE to be refused by")


def test_without_a_built_kernel_there_is_none():
    assert load("grabberd.core.kernel._not_there") is None


def test_a_kernel_of_an_older_build_counts_as_none(monkeypatch):
    monkeypatch.setitem(sys.modules, "_older", ModuleType("_older"))
    assert load("_older") is None


@needs_kernel
@pytest.mark.parametrize(
    "size",
    [
        (10, 9, 72, 0, 0, 2),
        (-1, 8, 64, 0, 0, 2),
        (8, 8, 65, 0, 0, 2),
        (8, 8, 64, 2, 0, 2),
        (8, 8, 64, 0, 0, 3),
        (8, 8, 56, 0, 0, 2),
        (1 << 40, 1 << 40, 64, 0, 0, 2),
        (0, 8, 64, 0, 0, 2),
    ],
)
def test_a_picture_that_does_not_fit_its_bytes_is_refused(size):
    assert KERNEL.locate(bytes(64), size, Settings(max_diameter_px=15), np.empty(90))[0] == REFUSED


@needs_kernel
def test_settings_of_another_length_are_refused():
    assert KERNEL.locate(bytes(64), (8, 8, 64, 0, 0, 2), bytes(8), np.empty(90))[0] == REFUSED


@needs_kernel
@pytest.mark.parametrize(
    "picture",
    [
        (8, 9, 8, 8, 0, 0, 2, 60),
        (8, 8, 8, 9, 0, 0, 2, 60),
        (8, 1, 8, 8, 0, 0, 1, 60),
        (7, 2, 4, 32, 0, 0, 2, 60),
        (1, 8, 8, 64, 0, 0, 2, 60),
        (6, 2, 6, 48, 0, 0, 2, 60),
        (8, 8, 8, 8, 2, 0, 2, 60),
        (8, 8, 8, 8, 3, 0, 1, 60),
        (8, 8, 8, 8, 0, 0, 3, 60),
        (8, 1 << 40, 1 << 40, 8, 0, 0, 2, 60),
        (2, 2, 16, 8, 0, 0, 2, 60),
        (8, 8, 8, 7, 0, 0, 2, 60),
    ],
)
def test_a_grey_picture_that_does_not_fit_its_bytes_is_refused(picture):
    table = np.zeros((5120, 2), np.float32)
    wanted = GreySettings(0, 15, 0, 0.8, 1, 1, 0, ctypes.c_void_p(table.ctypes.data), len(table))
    assert KERNEL.locate_grey(bytes(64), (8, 8, 8, 8, 0, 0, 2, 60), wanted, np.empty(90))[0] == DONE
    assert KERNEL.locate_grey(bytes(64), picture, wanted, np.empty(90))[0] == REFUSED


@needs_kernel
def test_settings_without_an_edge_are_refused():
    for wanted in (GreySettings(max_diameter_px=15), bytes(8)):
        assert KERNEL.locate_grey(bytes(64), (8, 8, 8, 8, 0, 0, 2, 60), wanted, np.empty(90))[0] == REFUSED


@needs_kernel
def test_arrays_that_are_too_short_are_refused():
    world, some, indices = World(targets=5), np.zeros(3), np.zeros(20, np.int64)
    assert KERNEL.near(world, some, some, *[some] * 6, 2.0, indices, np.zeros(180))[0] == REFUSED
    with pytest.raises(ValueError, match="do not belong together"):
        KERNEL.agree(world, *[some] * 7, some)
    values, rest = np.zeros((5, 2, 4)), np.zeros((7, 2))
    with pytest.raises(ValueError, match="do not belong together"):
        KERNEL.wall_forces(values[:, :1].copy(), rest, 1.0, np.zeros((2, 6, 4)), np.zeros((2, 6, 4, 4)))
    with pytest.raises(ValueError, match="do not belong together"):
        KERNEL.wall_stiffness(values, rest, 1.0, 0.0, np.zeros(1), np.zeros((2, 24, 24)))


def following_of(targets, cautious_targets=None):
    """Inputs of tracking for so many targets, and of identification for as many or others."""
    predictors, cautious = (
        Predictors.of(DisplacementField.of(np.eye(count, 3), Smoothness(), kernel=None))
        for count in (targets, cautious_targets or targets)
    )
    own, world = Following(), World(targets=targets)
    own.predictors = ctypes.addressof(predictors)
    own.identifying = Identifying(ctypes.addressof(world), ctypes.addressof(cautious))
    own.kept = predictors, cautious, world
    return own


@needs_kernel
@pytest.mark.parametrize(
    "wrong",
    [
        {"fields": ()},
        {"fields": (bytes(64),) * 65},
        {"room": -1},
        {"room": 1 << 40},
        {"settings": bytes(8)},
        {"world": bytes(8)},
        {"following": bytearray(8)},
        {"following": Following()},
        {"following": following_of(6)},
        {"following": following_of(5, 6)},
        {"track": 42},
        {"about": 7},
        {"indices": 49},
        {"kept": 481},
        {"held": 361},
    ],
)
def test_fields_with_too_little_room_are_refused(wrong):
    def measure(fields=(bytes(64),) * 2, room=9, world=None, following=None, settings=None, **lengths):
        given = {"track": 43, "about": 8, "indices": 50, "kept": 482, "held": 2 * 186} | lengths
        arrays = [
            np.zeros(count, np.intp if name == "indices" else np.float64) for name, count in given.items()
        ]
        return KERNEL.measure(
            fields,
            (1, 8, 8, 64, 2),
            room,
            Settings(max_diameter_px=15) if settings is None else settings,
            World(targets=5) if world is None else world,
            following_of(5) if following is None else following,
            *arrays,
        )

    assert measure() == 2
    with pytest.raises(ValueError, match="do not belong together"):
        measure(**wrong)


@needs_kernel
def test_a_field_that_is_no_buffer_is_an_error():
    with pytest.raises(TypeError):
        KERNEL.measure((bytes(64), 7), (1, 8, 8, 64, 2), 9, *[bytearray(8)] * 8)


PACKED = (1, 0, 0, 0, 60)
"""1 bit, intact, not smoothed, top, threshold 60."""


@needs_kernel
@pytest.mark.parametrize(
    ("how", "map_bytes", "out_bytes"),
    [
        ((1, 0, 0, 0, 60), 0, 17),
        ((1, 1, 0, 0, 60), 0, 16),
        ((2, 0, 0, 0, 60), 0, 16),
        ((8, 0, 0, 0, 60), 0, 16),
        ((7, 0, 0, 0, 60), 0, 112),
        ((0, 0, 0, 0, 60), 0, 16),
        ((-1, 0, 0, 0, 60), 0, 16),
        ((1, 0, 0, 2, 60), 0, 16),
        ((1, 0, 0, 0, 60), 71, 16),
        ((1, 1, 0, 0, 60), 72, 32),
        ((2, 0, 0, 0, 60), 72, 32),
    ],
)
def test_a_packed_field_that_does_not_fit_its_lines_is_refused(how, map_bytes, out_bytes):
    lines = np.zeros((8, 9), np.uint8)
    KERNEL.pack(lines, PACKED, bytes(72), bytearray(16))
    with pytest.raises(ValueError, match="do not belong together"):
        KERNEL.pack(lines, how, bytes(map_bytes), bytearray(out_bytes))


@needs_kernel
@pytest.mark.parametrize(
    "lines",
    [
        np.zeros(72, np.uint8),
        np.zeros((8, 3, 3), np.uint8),
        np.zeros((8, 9), np.uint16),
        np.zeros((0, 9), np.uint8),
        np.zeros((8, 0), np.uint8),
        np.broadcast_to(np.zeros(1, np.uint8), (8, 8193)),
        bytes(72),
    ],
)
def test_lines_that_are_no_rows_of_bytes_are_refused(lines):
    with pytest.raises(ValueError, match="no rows of bytes"):
        KERNEL.pack(lines, PACKED, b"", bytearray(16))


@needs_kernel
def test_a_single_line_is_not_doubled():
    with pytest.raises(ValueError, match="do not belong together"):
        KERNEL.pack(np.zeros((1, 9), np.uint8), (1, 1, 0, 0, 60), b"", bytearray(4))


@needs_kernel
@pytest.mark.parametrize(
    "wrong", [{"copy": 7}, {"good": 7}, {"memory": 7}, {"means": 1}, {"place": -1}, {"place": 64}]
)
def test_a_memory_that_does_not_fit_its_lines_is_refused(wrong):
    def take(copy=16, good=16, memory=594, place=63, means=0):
        arrays = [np.zeros(count, np.uint64) for count in (copy, good, memory)]
        KERNEL.take(
            np.zeros((8, 9), np.uint8),
            PACKED,
            b"",
            bytearray(16),
            *arrays,
            place,
            np.zeros(means, np.int16),
        )

    take()
    with pytest.raises(ValueError, match="do not belong together"):
        take(**wrong)


@needs_kernel
@pytest.mark.parametrize("size", [(2, 2), (0, 3), (-2, -3), (1 << 40, 3), (2, 1 << 40)])
def test_profiles_of_another_size_are_refused(size):
    means = np.zeros((2, 3), np.int16)
    assert KERNEL.shifted(means, means, 2, 3) == (-1, 0)
    with pytest.raises(ValueError, match="do not belong together"):
        KERNEL.shifted(means, means, *size)


@needs_kernel
@pytest.mark.parametrize("value", [-1, 256])
def test_profiles_that_are_no_grey_values_are_refused(value):
    means = np.full((2, 3), value, np.int16)
    with pytest.raises(ValueError, match="do not belong together"):
        KERNEL.shifted(means, means, 2, 3)


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_under_sanitisers_random_and_hostile_pictures_do_no_harm(tmp_path):
    if runtime() is None:
        pytest.skip("NO SANITISERS HERE: gcc with libasan and Python's headers are needed to look for faults")
    build(tmp_path)
    done = run(tmp_path, HERE / "hostile.py")
    assert done.returncode == 0, done.stderr[-3000:]
    assert "no harm" in done.stdout
