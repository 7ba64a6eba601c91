"""Points as a binary message: what one end writes, the other reads, and nothing else."""

import struct

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from numpy.typing import NDArray

from grabberd.documents.points_frame import POINT_BYTES, PointsFrame, decoded, encoded, symmetric, upper


def covariances(count: int, seed: int) -> NDArray[np.float64]:
    roots = np.random.default_rng(seed).normal(size=(count, 3, 3))
    product: NDArray[np.float64] = roots @ roots.transpose(0, 2, 1)
    return product


def frame(count: int = 5) -> PointsFrame:
    random = np.random.default_rng(count)
    return PointsFrame(
        n=4711,
        time_ns=-3,
        utc_us=1_700_000_000_000_000,
        published_ns=2**62,
        sequence=9,
        description=2,
        target=random.integers(0, 2**32, count, dtype=np.uint32),
        xyz_mm=random.normal(size=(count, 3)),
        covariance_mm2=upper(covariances(count, 1)),
        calibration_covariance_mm2=upper(covariances(count, 2)),
        residual_px=random.normal(size=count).astype(np.float32),
    )


@pytest.mark.parametrize("count", [0, 1, 5, 216])
def test_what_is_written_is_read_to_the_bit(count: int) -> None:
    written = frame(count)
    read = decoded(encoded(written))
    assert read[:6] == written[:6]
    for one, other in zip(read[6:], written[6:], strict=True):
        assert_array_equal(one, other)
        assert one.dtype == other.dtype


def test_it_is_laid_out_as_the_reference_says() -> None:
    message = encoded(frame(2))
    magic, version, size, n = struct.unpack_from("<4sHHQ", message, 0)
    assert (magic, version, size, n) == (b"GRBX", 1, 56, 4711)
    assert struct.unpack_from("<qqqQII", message, 16) == (-3, 1_700_000_000_000_000, 2**62, 9, 2, 2)
    assert len(message) == 56 + 2 * POINT_BYTES == 56 + 2 * 80
    assert struct.unpack_from("<6d", message, 56) == tuple(frame(2).xyz_mm.ravel())
    assert struct.unpack_from("<2I", message, 56 + 2 * 76) == tuple(frame(2).target)


def test_every_column_lies_at_a_multiple_of_its_numbers_size() -> None:
    for count in range(4):
        for column in decoded(encoded(frame(count)))[6:]:
            assert column.__array_interface__["data"][0] % 4 == 0


def test_a_covariance_survives_as_its_upper_triangle() -> None:
    matrices = covariances(7, 3)
    assert_array_equal(symmetric(upper(matrices)), matrices.astype(np.float32))


@pytest.mark.parametrize(
    "message",
    [
        b"",
        b"GRBX",
        b"GRBP" + encoded(frame())[4:],
        b"GRBX\2\0" + encoded(frame())[6:],
        b"GRBX\1\0\10\0" + encoded(frame())[8:],
        encoded(frame())[:-1],
        encoded(frame()) + b"x",
    ],
)
def test_anything_else_is_refused(message: bytes) -> None:
    with pytest.raises(ValueError, match="it "):
        decoded(message)


def test_the_header_may_become_longer() -> None:
    message = encoded(frame(3))
    longer = message[:6] + struct.pack("<H", 64) + message[8:56] + bytes(8) + message[56:]
    assert_array_equal(decoded(longer).xyz_mm, frame(3).xyz_mm)
