"""The preview message: what is sent is what the documents say."""

import itertools
import re
import threading
from collections.abc import Callable, Iterable
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from running import PATIENCE_S, running
from slots import ManualClock, damaged, slot, without_signal

from grabberd.core.chain.light import CLIPPED_LEVEL
from grabberd.core.field import BIT_DEPTHS, Field, NumberedField, quantise
from grabberd.core.ledger import Slot
from grabberd.instrument.acquisition import Ring
from grabberd.instrument.device.threshold_keeper import Shown
from grabberd.instrument.device.worker import Live
from grabberd.instrument.instrument import Instrument
from grabberd.instrument.live.preview import (
    LADDER,
    NO_CENTROIDS,
    OLD_NS,
    POINT,
    Centroids,
    Preview,
    PreviewField,
    View,
    preview_field,
)

DOCUMENT = Path(__file__).parents[3] / "docs" / "reference" / "live.md"
BITS_VIEW, GREY_VIEW = View(), View(grey=True)
HEADER_FIELDS = (
    (0, 4, "magic"), (8, 8, "n"), (16, 8, "time_us"), (24, 8, "centroids_us"), (32, 2, "columns"),
    (34, 2, "rows"), (36, 2, "y0"), (38, 2, "y_step"), (40, 2, "threshold"), (42, 1, "outcome"),
    (43, 1, "bits"), (44, 4, "centroids"), (48, 4, "deflated"), (52, 4, "points"), (56, 2, "x0"),
    (58, 2, "x_step"), (60, 2, "frame_columns"), (62, 2, "frame_lines"), (64, 1, "encoding"), (65, 1, "step"),
    (68, 4, "white"), (72, 4, "black"),
)  # fmt: skip
SIZE = 76


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


def shown(field: Field, one: Slot | None, found: Centroids = NO_CENTROIDS) -> PreviewField:
    """A field to look at, five seconds after 1970."""
    return preview_field(Shown(field, Ring(2, 1, "field")), one, found, 5_000_000, 90)


def message(field: Field, bits: int, found: Centroids = NO_CENTROIDS, view: View = BITS_VIEW) -> bytes:
    return shown(field, slot_of(field, bits), found).message(view)


def test_the_documented_decoder_reads_number_centroids_and_bits(decode: Callable[[bytes], Any]) -> None:
    field = picture()
    xy_px = np.array([[1.25, 2.5], [700.125, 3.0]], np.float32)
    n, centroids_px, bits = decode(message(field, 1, Centroids(4, xy_px)))
    assert n == 7
    assert (centroids_px == xy_px).all()
    assert (bits == (field.luma > 127)).all()


@pytest.mark.parametrize("bits", BIT_DEPTHS)
def test_whatever_bits_the_ring_has_the_message_has_one(decode: Callable[[bytes], Any], bits: int) -> None:
    field = picture()
    sent = message(field, bits)
    assert header(sent)["bits"] == bits
    pixels = decode(sent)[2]
    clear = (field.luma < 64) | (field.luma > 191)  # with few bits the level is not exactly the threshold
    assert (pixels == (field.luma > 127))[clear].all()
    if bits == 8:
        assert (pixels == (field.luma > 127)).all()


def test_the_header_says_what_is_documented() -> None:
    sent = message(picture(), 1, Centroids(4_000_000, np.zeros((3, 2), np.float32)))
    found = header(sent)
    assert sent[:4] == b"GRBP"
    assert (found["n"], found["time_us"], found["centroids_us"]) == (7, 5_000_000, 4_000_000)
    assert (found["columns"], found["rows"], found["y0"], found["y_step"]) == (21, 6, 1, 2)
    assert (found["threshold"], found["outcome"], found["centroids"]) == (127, 0, 3)
    assert (found["x0"], found["x_step"], found["frame_columns"], found["frame_lines"]) == (0, 1, 21, 12)
    assert (found["encoding"], found["white"]) == (0, 0)
    assert len(sent) == SIZE + 3 * 8 + found["deflated"]


def test_points_come_last_with_target_places_and_residual(decode: Callable[[bytes], Any]) -> None:
    points = np.zeros(2, POINT)
    points["target"], points["residual_px"] = [7, 108], [0.25, 0.5]
    points["image_px"] = [[[10, 20], [400, 21]], [[11, 22], [401, 23]]]
    sent = message(picture(), 1, Centroids(4, np.zeros((1, 2), np.float32), points))
    found = header(sent)
    assert found["points"] == 2
    assert len(sent) == SIZE + 8 + found["deflated"] + 2 * 24
    last = sent[-24:]
    assert int.from_bytes(last[:4], "little") == 108
    assert np.frombuffer(last[4:], "<f4").tolist() == [11, 22, 401, 23, 0.5]
    assert decode(sent)[2].shape == (6, 21)


def test_a_damaged_field_is_shown_as_one() -> None:
    assert header(shown(picture(), damaged(3)).message(GREY_VIEW))["outcome"] == 1


@pytest.mark.parametrize("view", [BITS_VIEW, GREY_VIEW])
def test_without_a_signal_there_is_no_picture(decode: Callable[[bytes], Any], view: View) -> None:
    sent = shown(picture(), without_signal(3)).message(view)
    assert header(sent)["outcome"] == 2
    assert decode(sent)[2] is None


def test_the_documented_decoder_reads_grey_values_and_what_is_clipped(decode: Callable[[bytes], Any]) -> None:
    field = picture()
    sent = message(field, 1, view=GREY_VIEW)
    found = header(sent)
    assert (found["encoding"], found["step"], found["bits"]) == (1, LADDER[0].step, 1)
    assert (found["columns"], found["rows"], found["y0"], found["y_step"]) == (21, 6, 1, 2)
    assert found["white"] == (field.luma >= CLIPPED_LEVEL).sum() > 0
    assert found["black"] == (field.luma <= 1).sum() > 0
    plain = (field.luma > 2) & (field.luma < CLIPPED_LEVEL)
    grey = decode(sent)[2]
    assert np.abs(grey.astype(int) - field.luma)[plain].max() <= LADDER[0].step / 2


def test_before_the_first_slot_of_a_new_ring_the_grey_picture_goes_on(decode: Callable[[bytes], Any]) -> None:
    field = picture()
    assert decode(shown(field, None).message(GREY_VIEW))[2].shape == field.luma.shape
    assert header(shown(field, None).message(GREY_VIEW))["threshold"] == 90
    assert decode(shown(field, None).message(BITS_VIEW))[2] is None


class Moment:
    """A device at one moment: the field that comes next, and those that were measured."""

    def __init__(self, field_ns: int | None, measured_ns: Iterable[int] = ()) -> None:
        self.clock = ManualClock(1_000_000_000)
        field, count = picture(), itertools.count(1)
        lives = [self._live(time_ns, next(count)) for time_ns in measured_ns]
        offered = None if field_ns is None else Shown(field, Ring(2, 1, "field"), field_ns)
        pipeline = SimpleNamespace(
            rate_hz=50.0,
            newest=SimpleNamespace(ask=lambda _: offered),
            ring=SimpleNamespace(newest=slot_of(field, 1)),
            thresholds=SimpleNamespace(in_force=SimpleNamespace(level=90)),
        )
        worker = SimpleNamespace(
            published=threading.Condition(), live=lives[-1] if lives else None, since=lambda _: lives
        )
        self.device = SimpleNamespace(pipeline=pipeline, worker=worker)

    def found(self) -> dict[str, int] | None:
        made = Preview(cast("Instrument", self.device), self.clock).make()
        return None if made is None else header(made.message(GREY_VIEW))

    def time_us(self, time_ns: int) -> int:
        now_us = round(self.clock.utc_now().timestamp() * 1e6)
        return now_us - (self.clock.now_ns() - time_ns) // 1000

    def _live(self, time_ns: int, number: int) -> Live:
        xy_px = np.array([[float(number), 1.0]])
        blobs = SimpleNamespace(xy_px=xy_px, at_border=np.zeros(1, bool))
        measured = SimpleNamespace(time_ns=time_ns, blobs=blobs, points=_NoPoints())
        return cast("Live", SimpleNamespace(measured=measured, number=number))


class _NoPoints:
    target: tuple[int, ...] = ()
    image_px = np.zeros((0, 2, 2))
    residual_px: tuple[float, ...] = ()

    def __len__(self) -> int:
        return 0


FIELD_NS = 20_000_000
NOW_NS = 900_000_000


def test_a_picture_has_its_own_time_and_the_targets_of_its_own_field() -> None:
    moment = Moment(NOW_NS, [NOW_NS - FIELD_NS, NOW_NS + 1000, NOW_NS + FIELD_NS])
    found = moment.found()
    assert found is not None
    assert found["time_us"] == moment.time_us(NOW_NS)
    assert found["centroids_us"] == moment.time_us(NOW_NS + 1000)


def test_a_field_that_is_not_measured_in_time_shows_the_targets_of_the_one_before() -> None:
    moment = Moment(NOW_NS, [NOW_NS - 2 * FIELD_NS])
    found = moment.found()
    assert found is not None
    assert found["centroids_us"] == moment.time_us(NOW_NS - 2 * FIELD_NS)
    assert found["centroids"] == 1


def test_targets_that_are_old_are_not_shown_on_a_new_picture() -> None:
    found = Moment(NOW_NS, [NOW_NS - OLD_NS - 1]).found()
    assert found is not None
    assert (found["centroids"], found["centroids_us"]) == (0, 0)


def test_where_nothing_is_measured_the_picture_comes_without_targets() -> None:
    found = Moment(NOW_NS).found()
    assert found is not None
    assert (found["rows"], found["centroids"]) == (6, 0)


def test_where_no_field_comes_nothing_is_shown() -> None:
    assert Moment(None).found() is None


def test_blobs_that_the_border_cuts_are_not_shown(tmp_path: Path, decode: Callable[[bytes], Any]) -> None:
    with running(tmp_path, {"pace": "real"}) as service:
        instrument = service.instrument(None)
        worker = instrument.worker
        with worker.published:
            assert worker.published.wait_for(lambda: worker.live is not None, PATIENCE_S)
        preview = Preview(instrument, service.clock)
        made = next(one for _ in range(1000) if (one := preview.make()) and len(one.found.xy_px))
    _, centroids_px, grey = decode(made.message(GREY_VIEW))
    assert centroids_px[:, 1].min() > 8  # the simulator's stamp, in the corner, is cut
    same = abs(made.time_us - made.found.time_us) < 1000
    row, column = np.rint((centroids_px[:, ::-1] - [made.grey.y0, 0]) / [2, 1]).astype(int).T
    assert not same or (grey[row, column] > 60).mean() > 0.9
