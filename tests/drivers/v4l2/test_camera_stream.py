"""A progressive stream at any rate: what was lost or damaged is in the account, by count and by time."""

import itertools
import random
from fractions import Fraction

import numpy as np
import pytest

from core.measurement.test_progressive import drawn
from drivers.v4l2.bench import Bench, camera
from drivers.v4l2.fake_kernel import number_in, number_in_blocks
from drivers.v4l2.playing import Play
from drivers.v4l2.taking import numbered, take
from grabberd.core.field import PROGRESSIVE
from grabberd.core.ledger import Outcome
from grabberd.core.measurement import LocationSettings, measure
from grabberd.errors import DeviceLost

RATES = (5, 15, 25, Fraction(30_000, 1001), 30, 50, 60, 120, 200)
SECONDS = 4.0


def grey(rate, size=(64, 48)):
    return {"GREY": {size: (rate,)}}


def jpegs(**traits):
    return camera(modes={"MJPG": {(320, 240): (60,)}}, **traits)


def asked(rate):
    return {"rate_hz": float(rate)}


class Seen:
    """A stream through the capture thread and the ring, with its account."""

    def __init__(self, folder, made, rate, prepare=lambda play: None, seconds=SECONDS, **options):
        self.play = Play(folder, made, **asked(rate), **options)
        prepare(self.play)
        self.play.run(seconds)
        self.slots = self.play.slots
        self.numbers = self.play.camera_numbers
        self.missing = self.play.missing
        self.truly_missing = self.play.truly_missing

    @property
    def is_true(self):
        """Each slot has the camera's number, and its time to half a period."""
        first = self.slots[0].n - self.numbers[0]
        period_ns = self.play.card.period_ns
        return all(
            slot.n - number == first and abs(slot.time_ns - self._middle_ns(number)) < period_ns / 2
            for slot, number in zip(self.slots, self.numbers, strict=True)
        )

    def _middle_ns(self, number):
        return self.play.card.time_of(number) + self.play.card.period_ns / 2


@pytest.mark.parametrize("rate", RATES, ids=str)
def test_a_steady_stream_is_complete_at_every_rate(tmp_path, rate):
    seen = Seen(tmp_path, camera(modes=grey(rate)), rate)
    assert seen.is_true
    assert seen.play.ledger.complete
    assert seen.play.rebases == []
    assert len(seen.slots) > float(rate) * (SECONDS - 1)


@pytest.mark.parametrize("rate", RATES, ids=str)
@pytest.mark.parametrize("counted", [True, False], ids=["counted", "uncounted"])
def test_lost_pictures_are_told_by_the_count_and_by_time(tmp_path, rate, counted):
    def lose(play):
        play.card.lost = {40, 50, 51}
        play.card.uncounted = set() if counted else play.card.lost

    seen = Seen(tmp_path, camera(modes=grey(rate)), rate, lose, seconds=90 / rate)
    assert seen.is_true
    assert seen.missing == seen.truly_missing
    assert len(seen.missing) == 3


def test_an_uncounted_loss_before_anything_is_known_of_the_stream_is_in_doubt_by_enough(tmp_path):
    def lose(play):
        play.card.lost = play.card.uncounted = {8, 12, 13}

    seen = Seen(tmp_path, camera(modes=grey(60)), 60, lose)
    first = seen.slots[0].n - seen.numbers[0]
    off = {slot.n for slot, number in zip(seen.slots, seen.numbers, strict=True) if slot.n - number != first}
    assert off <= set(seen.play.uncertain)
    assert seen.slots[-1].n - seen.numbers[-1] == first


@pytest.mark.parametrize(("declared", "true"), [(30, 29.97), (30, 29.9), (60, 60.2)])
def test_a_cameras_own_clock_may_differ_from_its_word_by_a_third_of_a_per_cent(tmp_path, declared, true):
    def drift(play):
        start = play.card.start

        def started(now_ns):
            play.card.rate_hz = Fraction(true).limit_denominator(1000)
            start(now_ns)

        play.card.start = started

    seen = Seen(tmp_path, camera(modes=grey(declared)), declared, drift, seconds=20.0)
    assert seen.is_true
    assert seen.play.ledger.complete


@pytest.mark.parametrize("rate", [30, 60, 120])
@pytest.mark.parametrize("seed", range(3))
def test_stamps_that_jitter_by_a_third_of_the_period_invent_no_loss(tmp_path, rate, seed):
    draw = random.Random(seed)

    def jitter(play):
        period_ns = play.card.period_ns
        play.card.stamp = lambda due_ns: due_ns - period_ns + round(draw.uniform(0, period_ns / 3))
        play.card.lost = {40}

    seen = Seen(tmp_path, camera(modes=grey(rate)), rate, jitter)
    assert seen.missing == seen.truly_missing
    assert len(seen.missing) == 1


@pytest.mark.parametrize("rate", [60, 120, 200])
@pytest.mark.parametrize("batch_ms", [4, 8])
def test_arrivals_in_batches_of_the_bus_neither_lose_nor_invent(tmp_path, rate, batch_ms):
    def batch(play):
        card = play.card
        card.stamp = lambda _: card.time_of(card.unit)  # by the camera's own clock
        due_ns = card.due_ns

        def batched_ns():
            time_ns, batch_ns = due_ns(), batch_ms * 1_000_000
            return None if time_ns is None else -(-time_ns // batch_ns) * batch_ns

        card.due_ns = batched_ns
        card.lost = {90, 91}

    seen = Seen(tmp_path, camera(modes=grey(rate)), rate, batch, buffers=32)
    assert seen.is_true
    assert seen.missing == seen.truly_missing
    assert len(seen.missing) == 2
    assert seen.play.uncertain == []


@pytest.mark.parametrize("size", [(640, 480), (1280, 720)])
def test_the_ring_takes_pictures_of_any_size(tmp_path, size):
    seen = Seen(tmp_path, camera(modes=grey(60, size)), 60, seconds=1.0)
    assert seen.is_true
    assert seen.play.newest.data.shape == (1, size[1], size[0])


@pytest.mark.parametrize(("fourcc", "rms_px"), [("YUYV", 0.022), ("NV12", 0.022), ("MJPG", 0.025)])
def test_discs_are_located_in_the_ring_where_they_were_before_the_camera(tmp_path, fourcc, rms_px):
    picture, places = drawn(7)
    seen = camera(modes={fourcc: {(640, 480): (60,)}}, scene=lambda *_: picture)
    play = Play(tmp_path, seen, size="640x480", rate_hz=60).run(0.5)
    assert len(play.slots) > 10
    packed = play.newest
    assert (packed.parity, packed.y0, packed.y_step) == (PROGRESSIVE, 0, 1)
    blobs = measure(packed, None, LocationSettings())
    assert len(blobs) == len(places)
    nearest = np.linalg.norm(blobs.xy_px[:, np.newaxis] - places, axis=2).argmin(axis=1)
    assert np.sqrt(((blobs.xy_px - places[nearest]) ** 2).mean(axis=0)).max() < rms_px


def test_a_program_that_is_stopped_loses_what_the_buffers_could_not_hold(tmp_path):
    def stop(play):
        play.scheduler.stops = ((2.0, 3.0),)

    seen = Seen(tmp_path, camera(modes=grey(120)), 120, stop, seconds=5.0, buffers=32)
    assert seen.is_true
    assert seen.missing == seen.truly_missing
    assert abs(len(seen.missing) - (120 - 32)) <= 2
    assert seen.play.causes == {"program stopped"}


def test_a_camera_that_is_pulled_out_is_lost(tmp_path):
    bench = Bench(tmp_path, camera())
    bench.info = bench.grabber.open()
    take(bench, 3)
    bench.unplug()
    with pytest.raises(DeviceLost), bench.grabber.dequeue(0.5):
        pass


# --- compressed ---


def test_compressed_pictures_come_decoded_and_in_order(tmp_path):
    bench = Bench(tmp_path, jpegs())
    bench.info = bench.grabber.open()
    fields = take(bench, 30)
    found = [number_in_blocks(one.field.luma) for one in fields]
    assert all(b == a + 1 for a, b in itertools.pairwise(found))
    assert [one.damage for one in fields] == [None] * 30


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda data: data[: data.size // 2], "broken JPEG: data are missing"),
        (lambda data: data[:40], "broken JPEG: its header breaks off"),
        (lambda data: data[:0], "broken JPEG: it is empty"),
        (lambda data: np.roll(data, 7), "broken JPEG: it does not begin like one"),
    ],
)
def test_a_broken_picture_is_a_damaged_field_by_name_and_the_stream_goes_on(tmp_path, spoil, said):
    bench = Bench(tmp_path, jpegs(spoilt={10: spoil, 11: spoil}))
    bench.info = bench.grabber.open()
    found = numbered(bench, take(bench, 40))
    assert [one.n for one in found] == list(range(len(found)))
    damaged = {one.n: one.reason for one in found if one.outcome is Outcome.DAMAGED}
    assert damaged == {10: said, 11: said}


def test_a_stream_begins_with_its_first_whole_picture(tmp_path):
    bench = Bench(tmp_path, jpegs(spoilt={0: lambda data: data[:0]}))
    bench.info = bench.grabber.open()
    with bench.grabber.dequeue(1.0) as fields:
        assert fields == []
    assert take(bench, 1)[0].damage is None


def test_a_flag_of_the_driver_is_named_before_what_it_did_to_the_picture(tmp_path):
    bench = Bench(tmp_path, jpegs(flagged={10}, spoilt={10: lambda data: data[: data.size // 2]}))
    bench.info = bench.grabber.open()
    assert take(bench, 12)[10].damage == "the driver flags an error"


def test_the_number_in_a_grey_picture_is_the_cameras(tmp_path):
    bench = Bench(tmp_path, camera(modes=grey(60)))
    bench.info = bench.grabber.open()
    assert number_in(take(bench, 1)[0].field.luma) == bench.card.first_unit
