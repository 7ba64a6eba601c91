"""The preview message: what is sent is what the documents say."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from running import PATIENCE_S, configuration, running
from slots import ManualClock, damaged, slot, without_signal

from grabberd.acquisition import Slot
from grabberd.field import BIT_DEPTHS, Field, NumberedField, quantise
from grabberd.service.instrument import Instrument
from grabberd.service.live.preview import NO_CENTROIDS, POINT, Centroids, Preview, message

DOCUMENT = Path(__file__).parents[3] / "docs" / "reference" / "live.md"
SLOTS = 512
"""Ten seconds: a worker that is late on a busy computer has measured one of these."""
HEADER_FIELDS = (
    (0, 4, "magic"), (8, 8, "n"), (16, 8, "time_us"), (24, 8, "centroids_us"), (32, 2, "columns"),
    (34, 2, "rows"), (36, 2, "y0"), (38, 2, "y_step"), (40, 2, "threshold"), (42, 1, "outcome"),
    (43, 1, "bits"), (44, 4, "centroids"), (48, 4, "deflated"), (52, 4, "points"),
)  # fmt: skip


@pytest.fixture(scope="module")
def decode() -> Callable[[bytes], Any]:
    """The documented decoder."""
    code = re.search(r"```python\n(.*?)```", DOCUMENT.read_text(), re.DOTALL)
    assert code is not None
    names: dict[str, Any] = {}
    exec(code[1], names)
    decoder: Callable[[bytes], Any] = names["decode"]
    return decoder


def header(sent: bytes) -> dict[str, int]:
    return {name: int.from_bytes(sent[at : at + size], "little") for at, size, name in HEADER_FIELDS}


def picture(columns: int = 21) -> Field:
    luma = np.random.default_rng(1).integers(0, 256, (6, columns)).astype(np.uint8)
    return Field.intact(luma, 1)


def slot_of(field: Field, bits: int) -> Slot:
    packed = quantise(field, bits, 127)
    return slot(7)._replace(numbered=NumberedField(7, 0, 7, packed))


def test_the_documented_decoder_reads_number_centroids_and_bits(decode: Callable[[bytes], Any]) -> None:
    field = picture()
    xy_px = np.array([[1.25, 2.5], [700.125, 3.0]], np.float32)
    n, centroids_px, bits = decode(message(slot_of(field, 1), 5, Centroids(4, xy_px)))
    assert n == 7
    assert (centroids_px == xy_px).all()
    assert (bits == (field.luma > 127)).all()


@pytest.mark.parametrize("bits", BIT_DEPTHS)
def test_whatever_bits_the_ring_has_the_message_has_one(decode: Callable[[bytes], Any], bits: int) -> None:
    field = picture()
    sent = message(slot_of(field, bits), 5, NO_CENTROIDS)
    assert header(sent)["bits"] == bits
    shown = decode(sent)[2]
    clear = (field.luma < 64) | (field.luma > 191)  # with few bits the level is not exactly the threshold
    assert (shown == (field.luma > 127))[clear].all()
    if bits == 8:
        assert (shown == (field.luma > 127)).all()


def test_the_header_says_what_is_documented() -> None:
    sent = message(slot_of(picture(), 1), 5_000_000, Centroids(4_000_000, np.zeros((3, 2), np.float32)))
    found = header(sent)
    assert sent[:4] == b"GRBP"
    assert (found["n"], found["time_us"], found["centroids_us"]) == (7, 5_000_000, 4_000_000)
    assert (found["columns"], found["rows"], found["y0"], found["y_step"]) == (21, 6, 1, 2)
    assert (found["threshold"], found["outcome"], found["centroids"]) == (127, 0, 3)
    assert len(sent) == 56 + 3 * 8 + found["deflated"]


def test_points_come_last_with_target_places_and_residual(decode: Callable[[bytes], Any]) -> None:
    points = np.zeros(2, POINT)
    points["target"], points["residual_px"] = [7, 108], [0.25, 0.5]
    points["image_px"] = [[[10, 20], [400, 21]], [[11, 22], [401, 23]]]
    sent = message(slot_of(picture(), 1), 5, Centroids(4, np.zeros((1, 2), np.float32), points))
    found = header(sent)
    assert found["points"] == 2
    assert len(sent) == 56 + 8 + found["deflated"] + 2 * 24
    last = sent[-24:]
    assert int.from_bytes(last[:4], "little") == 108
    assert np.frombuffer(last[4:], "<f4").tolist() == [11, 22, 401, 23, 0.5]
    assert decode(sent)[2].shape == (6, 21)


def test_a_damaged_field_is_shown_as_one() -> None:
    assert header(message(damaged(3), 0, NO_CENTROIDS))["outcome"] == 1


def test_without_a_signal_there_is_no_picture(decode: Callable[[bytes], Any]) -> None:
    sent = message(without_signal(3), 0, NO_CENTROIDS)
    assert header(sent)["outcome"] == 2
    assert decode(sent)[2] is None


@pytest.fixture(scope="module")
def stopped(tmp_path_factory: pytest.TempPathFactory) -> Instrument:
    """An instrument that has measured, and does so no more; its ring still has what it measured last."""
    ring = configuration({}).devices["simulated"].ring.model_copy(update={"slots": SLOTS})
    with running(tmp_path_factory.mktemp("preview"), {"pace": "real"}, ring=ring) as service:
        instrument = service.instrument(None)
        worker = instrument.worker
        with worker.published:
            assert worker.published.wait_for(lambda: worker.live is not None, PATIENCE_S)
    return instrument


def test_a_field_is_shown_once_and_with_its_time(stopped: Instrument) -> None:
    clock = ManualClock()
    preview = Preview(stopped, clock)
    sent = preview.make()
    assert sent is not None
    assert preview.make() is None
    newest = stopped.pipeline.ring.newest
    assert newest is not None
    assert newest.numbered is not None
    now_us = round(clock.utc_now().timestamp() * 1e6)
    assert header(sent)["time_us"] == now_us - (clock.now_ns() - newest.numbered.time_ns) // 1000


def test_centroids_are_those_of_the_newest_measured_field(
    stopped: Instrument, decode: Callable[[bytes], Any]
) -> None:
    live, reader = stopped.worker.live, stopped.pipeline.ring.reader(back=SLOTS)
    assert live is not None
    slots = [slot for _ in range(SLOTS) if (slot := reader.take(0)) is not None]
    [same] = [one for one in slots if one.numbered and one.numbered.time_ns == live.measured.time_ns]
    preview = Preview(stopped, ManualClock())
    _, centroids_px, bits = decode(message(same, 0, preview._centroids(live)))
    assert len(centroids_px) == len(live.measured.blobs) > 0
    row, column = np.rint(centroids_px[:, ::-1]).astype(int).T
    assert bits[row, column].mean() > 0.9
