"""Scans of a buffer, decoded by the types that the kernel states."""

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grabberd_loggers.iio.readers import Element, ScanFormat


def test_elements_lie_at_multiples_of_their_size() -> None:
    scan = ScanFormat(
        [
            Element("timestamp", 2, "le:s64/64>>0"),
            Element("a", 0, "be:u12/16>>4"),
            Element("b", 1, "le:s24/32>>8"),
        ]
    )
    assert scan.bytes == 16
    data = struct.pack(">H2x", 0xABC << 4) + struct.pack("<i", -5 << 8) + struct.pack("<q", 123)
    found = scan.decode(data * 3)
    assert {name: values.tolist() for name, values in found.items()} == {
        "a": [0xABC] * 3,
        "b": [-5] * 3,
        "timestamp": [123] * 3,
    }


@given(st.integers(1, 64), st.booleans(), st.sampled_from(["le", "be"]), st.data())
def test_a_number_comes_back_from_any_type(bits: int, signed: bool, order: str, data: st.DataObject) -> None:
    storage = next(size for size in (8, 16, 32, 64) if size >= bits)
    shift = data.draw(st.integers(0, storage - bits))
    low, high = (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) if signed else (0, min(2**bits, 2**63) - 1)
    number = data.draw(st.integers(low, high))
    padding = data.draw(st.integers(0, 2**shift - 1))
    raw = ((number % 2**bits) << shift | padding).to_bytes(storage // 8, "little" if order == "le" else "big")
    scan = ScanFormat([Element("a", 0, f"{order}:{'s' if signed else 'u'}{bits}/{storage}>>{shift}")])
    assert scan.decode(raw)["a"].tolist() == [number]


@pytest.mark.parametrize("kind", ["", "le:f32/32", "le:s12/16X3>>4", "le:s40/32", "le:s12/16>>8", "xe:s8/8"])
def test_a_type_that_is_not_known_is_refused(kind: str) -> None:
    with pytest.raises(ValueError, match="a has the type"):
        ScanFormat([Element("a", 0, kind)])
