"""Recordings are played as a grabber would have delivered them."""

import csv

import cv2
import numpy as np
import pytest

from archive.captures import meta, same_field, slot, slots, write
from drivers.replay.pictures import frames, luma, manifest, png
from drivers.replay.playing import PERIOD_NS, play, rows
from grabberd.archive.export.field_pictures import export_png
from grabberd.core.field import FieldOrder, double_lines, quantise, unpack
from grabberd.core.ledger import Outcome
from grabberd.errors import DeviceAbsent, DeviceLost, DeviceRefused, PictureError, StreamEnded
from grabberd.instrument.acquisition import Signal
from grabberd_replay import ReplayGrabber
from instrument.acquisition.streams import numbers

# --- frames ---


def test_frames_are_split_into_fields_the_top_one_first(tmp_path):
    info, played, end = play(frames(tmp_path))
    assert rows(played) == [(0, 0, 2), (1, 1, 2)] * 3
    np.testing.assert_array_equal(played[2].field.luma, luma(1)[0::2])
    np.testing.assert_array_equal(played[3].field.luma, luma(1)[1::2])
    assert isinstance(end, StreamEnded)
    assert (info.columns, info.field_rows, info.field_order) == (720, 288, FieldOrder.TOP_FIRST)


def test_the_bottom_field_can_be_the_older(tmp_path):
    info, played, _ = play(frames(tmp_path), field_order="bottom_first")
    assert rows(played) == [(1, 1, 2), (0, 0, 2)] * 3
    assert info.field_order is FieldOrder.BOTTOM_FIRST


def test_pictures_without_times_are_twenty_milliseconds_apart(tmp_path):
    _, played, _ = play(frames(tmp_path))
    assert [f.time_ns for f in played] == [n * PERIOD_NS for n in range(6)]
    assert [f.sequence for f in played] == list(range(6))


def test_another_rate_can_be_said(tmp_path):
    info, played, _ = play(frames(tmp_path), rate_hz=60)
    assert info.rate_hz == 60.0
    assert played[1].time_ns == round(1e9 / 60)


# --- fields ---


def test_fields_alternate_from_the_first_parity(tmp_path):
    info, played, _ = play(frames(tmp_path, lines=288))
    assert rows(played) == [(0, 0, 2), (1, 1, 2), (0, 0, 2)]
    assert info.field_rows == 288
    _, played, _ = play(tmp_path, first_parity="bottom")
    assert [f.field.parity for f in played] == [1, 0, 1]


def test_colours_are_converted_and_that_is_said(tmp_path):
    for n in range(2):
        (tmp_path / f"{n}.png").write_bytes(png(np.repeat(luma(n)[..., None], 3, axis=2)))
    info, played, _ = play(tmp_path)
    np.testing.assert_array_equal(played[0].field.luma, luma(0)[0::2])
    assert "Rec. 601" in info.details["colours"]


# --- order and gaps of names ---


def test_numbers_in_names_are_ordered_by_their_value(tmp_path):
    _, played, _ = play(frames(tmp_path, count=11, lines=288, columns=32, name="f{}.png"))
    np.testing.assert_array_equal(played[10].field.luma, luma(10, 288, 32))
    assert len(played) == 11


def test_a_picture_that_the_count_in_the_names_lacks_is_lost_and_named(tmp_path):
    frames(tmp_path, count=6)
    (tmp_path / "frame-0003.png").unlink()
    info, played, _ = play(tmp_path)
    assert [one.sequence for one in played] == [0, 1, 2, 3, 4, 5, 8, 9, 10, 11]
    assert any("1 picture is missing after frame-0002.png" in one for one in info.remarks)


def test_numbers_may_go_in_larger_steps(tmp_path):
    frames(tmp_path, count=9, lines=288, columns=32)
    for n in (1, 3, 5, 7):
        (tmp_path / f"frame-{n:04d}.png").unlink()
    assert len(play(tmp_path)[1]) == 5


def test_names_without_numbers_tell_of_no_gaps(tmp_path):
    for name in ("anna", "berit", "cow7", "dagros"):
        (tmp_path / f"{name}.png").write_bytes(png(luma(0, 288, 32)))
    assert len(play(tmp_path)[1]) == 4


def test_a_truncated_picture_is_named_and_what_came_before_is_played(tmp_path):
    path = frames(tmp_path) / "frame-0002.png"
    path.write_bytes(path.read_bytes()[:1000])
    _, played, error = play(tmp_path)
    assert len(played) == 4
    assert "frame-0002.png" in error.message
    assert "720x576" in error.message


def test_a_picture_of_another_size_is_named_and_what_came_before_is_played(tmp_path):
    (frames(tmp_path) / "frame-0001.png").write_bytes(png(luma(1, 574)))
    _, played, error = play(tmp_path)
    assert len(played) == 2
    assert "frame-0001.png is 720x574 grey, expected 720x576 grey" in error.message


def test_the_error_stays_when_asked_again(tmp_path):
    (frames(tmp_path, 2) / "frame-0001.png").write_bytes(b"")
    grabber = ReplayGrabber(tmp_path)
    grabber.open()
    with grabber.dequeue(0):
        pass
    for _ in range(2):
        with pytest.raises(PictureError), grabber.dequeue(0):
            pass


def test_a_first_picture_that_cannot_be_read_is_told_at_once(tmp_path):
    (tmp_path / "0.png").write_bytes(b"rubbish")
    with pytest.raises(PictureError, match=r"0\.png"):
        ReplayGrabber(tmp_path).open()


# --- captures and their exports ---

CAPTURED = [*slots(5, bits=8), slot(8, lost=3, bits=8), slot(9, Outcome.DAMAGED, "repeated", bits=8)]


@pytest.fixture
def capture(tmp_path):
    return write(tmp_path, CAPTURED, bits=8)


def test_a_capture_is_played_with_its_times_parities_and_gaps(capture):
    info, played, _ = play(capture)
    for one, other in zip(CAPTURED, played, strict=True):
        assert other.time_ns == one.numbered.time_ns
        assert other.sequence == one.numbered.sequence
        assert other.field.parity == one.n % 2
        np.testing.assert_array_equal(other.field.luma, unpack(one.numbered.packed).luma)
    assert played[-1].damage == "repeated"
    assert info.details["capture"] == meta().id
    assert not info.live


def test_a_capture_that_is_being_written_can_be_played(tmp_path, capture):
    assert len(play(capture.rename(tmp_path / "x.grab.part"))[1]) == 7


@pytest.mark.parametrize(("bits", "doubled"), [(1, True), (1, False), (3, False), (8, False), (8, True)])
def test_a_capture_played_again_packs_to_the_same_bits(tmp_path, bits, doubled):
    taken = slots(6, bits=bits, doubled=doubled)
    for path in (write(tmp_path, taken, bits=bits), exported(tmp_path)):
        _, played, _ = play(path)
        found = numbers(played, ReplayGrabber(path).open())
        for one, other, number in zip(taken, played, found, strict=True):
            again = quantise(double_lines(other.field) if doubled else other.field, bits, 128)
            threshold = one.numbered.packed.threshold
            packed = quantise(double_lines(other.field) if doubled else other.field, bits, threshold)
            np.testing.assert_array_equal(again.data, one.numbered.packed.data)
            same_field(one.numbered._replace(packed=packed), one.numbered)
            assert (number.n, number.time_ns) == (one.n, one.numbered.time_ns)


def exported(tmp_path):
    export_png(tmp_path / "liner.grab", tmp_path / "out")
    return tmp_path / "out"


def woven(folder):
    """The folder with its fields as frames, each of a top field and the bottom field after it."""
    with (folder / "fields.csv").open(newline="") as file:
        _, *fields = csv.reader(file)
    listed, lumas = [], {}
    for *field, name in fields:
        parity, one = int(field[3]), cv2.imread(str(folder / name), cv2.IMREAD_UNCHANGED)
        frame = f"frame-{int(field[0]) - parity:08d}.png"
        lumas.setdefault(frame, np.zeros((2 * len(one), one.shape[1]), np.uint8))[parity::2] = one
        listed.append((*field, frame))
    for name, whole in lumas.items():
        (folder / name).write_bytes(png(whole))
    manifest(folder, listed)
    return folder


@pytest.mark.parametrize("shown", [lambda folder: folder, woven])
def test_the_exported_pictures_are_played_like_the_capture(tmp_path, capture, shown):
    (one, from_file, _), (other, from_pictures, _) = play(capture), play(shown(exported(tmp_path)))
    assert (one.columns, one.field_rows, one.rate_hz) == (other.columns, other.field_rows, other.rate_hz)
    for a, b in zip(from_file, from_pictures, strict=True):
        assert (a.time_ns, a.sequence, rows([a])) == (b.time_ns, b.sequence, rows([b]))
        assert (a.damage is None) == (b.damage is None)
        np.testing.assert_array_equal(a.field.luma, b.field.luma)


def test_gaps_of_a_recording_are_gaps_again(tmp_path, capture):
    for path in (capture, exported(tmp_path)):
        info, played, _ = play(path)
        found = numbers(played, info)
        assert [f.n for f in found] == [0, 1, 2, 3, 4, 8, 9]
        assert found[5].lost_before[0].count == 3


def test_a_count_that_told_of_every_loss_is_said_to(tmp_path):
    frames(tmp_path, lines=288, columns=32)
    row = [(n, n * PERIOD_NS, 70 + n, n % 2, n % 2, 2, "received", f"frame-{n:04d}.png") for n in range(3)]
    manifest(tmp_path, row)
    assert play(tmp_path)[0].counts_losses
    manifest(tmp_path, [(*r[:2], "", *r[3:]) for r in row])
    info, played, _ = play(tmp_path)
    assert not info.counts_losses
    assert played[0].sequence is None


@pytest.mark.parametrize("rate_hz", [25, 50, 60_000 / 1001, 60, 100, 120])
@pytest.mark.parametrize("fast", [1.0, 1.0002])
def test_the_times_of_an_exported_capture_tell_its_rate(tmp_path, rate_hz, fast):
    """Also those of a camera whose clock is off; a field is missing."""
    frames(tmp_path, lines=40, columns=32)
    times_ns = [round(n * 1e9 / (rate_hz * fast)) for n in range(4)]
    row = [(n, times_ns[n], n, 2, 0, 1, "received", f"frame-{i:04d}.png") for i, n in enumerate((0, 1, 3))]
    manifest(tmp_path, row)
    assert play(tmp_path)[0].rate_hz == pytest.approx(rate_hz, rel=1e-12)
    assert play(tmp_path, rate_hz=30.0)[0].rate_hz == 30.0


def test_a_picture_that_the_manifest_lists_must_be_there(tmp_path, capture):
    folder = exported(tmp_path)
    (folder / "field-00000003.png").unlink()
    _, played, error = play(folder)
    assert len(played) == 3
    assert "field-00000003.png is missing; expected 40x24 grey" in error.message


@pytest.mark.parametrize(
    ("rows_of_it", "message"),
    [
        ([], "lists no fields"),
        ([(0, "soon", 0, 0, 0, 2, "received", "a.png")], "line 2 cannot be understood"),
        ([(0, 0, 0, 0, 0, 2, "eaten", "a.png")], "eaten"),
        ([(0, 0, 0, 7, 0, 2, "received", "a.png")], "line 2 .*parity is 7"),
        ([(0, 0, 0, 0, 0, 0, "received", "a.png")], "line 2 .*y_step is 0"),
        ([(0, 1 << 63, 0, 0, 0, 2, "received", "a.png")], "line 2 .*time_ns is 9223372036854775808"),
        ([("9" * 5000, 0, 0, 0, 0, 2, "received", "a.png")], "line 2 .*4300 digits"),
        ([(0, 0, 0, 0, 0, 2, "received", "")], "line 2 .*'' is not a file's name"),
        ([(0, 0, 0, 0, 0, 2, "received", "a\0.png")], "line 2 .*is not a file's name"),
        ([(0, 0, 0, 0, 0, 2, "received", "a" * 200_000)], "cannot be read: line 2 is not CSV"),
        ([(n, 0, 0, 0, 0, 2, "received", "a.png") for n in (1, 0)], "do not ascend"),
    ],
)
def test_a_manifest_that_cannot_be_understood_is_refused(tmp_path, rows_of_it, message):
    manifest(tmp_path, rows_of_it)
    with pytest.raises(DeviceRefused, match=message):
        ReplayGrabber(tmp_path).open()


def test_a_manifest_names_no_files_outside_its_folder(tmp_path):
    folder = frames(tmp_path / "in", 1, lines=288, columns=32)
    (tmp_path / "secret.png").write_bytes(png(luma(0, 288, 32)))
    manifest(folder, [(0, 0, 0, 0, 0, 2, "received", "../secret.png")])
    with pytest.raises(PictureError, match=r"in/secret\.png is missing"):
        ReplayGrabber(folder).open()


def test_numbers_in_names_that_are_no_digits_do_no_harm(tmp_path):
    folder = frames(tmp_path, 2, lines=288, columns=32, name="²-{}.png")
    assert len(play(folder)[1]) == 2


# --- what is no recording ---


def test_a_path_that_is_not_there_is_absent(tmp_path):
    with pytest.raises(DeviceAbsent, match="gone"):
        ReplayGrabber(tmp_path / "gone").open()


def test_a_folder_without_pictures_is_refused(tmp_path):
    with pytest.raises(DeviceRefused, match="has no pictures"):
        ReplayGrabber(tmp_path).open()


def test_a_file_that_is_no_capture_is_refused(tmp_path):
    (tmp_path / "x.grab").write_bytes(b"text " * 999)
    with pytest.raises(DeviceRefused, match="capture"):
        ReplayGrabber(tmp_path / "x.grab").open()


def test_a_capture_without_fields_is_refused(tmp_path):
    with pytest.raises(DeviceRefused, match="has no fields"):
        ReplayGrabber(write(tmp_path, [slot(0, Outcome.NO_SIGNAL, "no signal")])).open()


@pytest.mark.parametrize(
    "options",
    [
        {"pictures": "stripes"},
        {"field_order": "alternate"},
        {"field_order": "sideways"},
        {"first_parity": "left"},
        {"pace": "slow"},
        {"rate_hz": 0},
    ],
)
def test_options_that_make_no_sense_are_refused_by_value(options):
    (value,) = options.values()
    with pytest.raises(ValueError, match=str(value)):
        ReplayGrabber("somewhere", **options)


# --- pace ---


class StandingClock:
    """Moves only when somebody sleeps."""

    def __init__(self):
        self.time_ns = 77_000_000_000

    def now_ns(self):
        return self.time_ns

    def sleep(self, seconds):
        self.time_ns += max(0, round(seconds * 1e9))


def test_at_real_pace_a_frame_comes_when_its_second_field_is_over(tmp_path):
    clock = StandingClock()
    grabber = ReplayGrabber(frames(tmp_path), pace="real", clock=clock)
    assert not grabber.open().waits_for_reader
    arrived = []
    for _ in range(3):
        with grabber.dequeue(1.0) as fields:
            assert len(fields) == 2
            arrived.append(clock.time_ns - 77_000_000_000)
    assert arrived == [0, 2 * PERIOD_NS, 4 * PERIOD_NS]


def test_at_real_pace_nothing_comes_before_it_is_due(tmp_path):
    clock = StandingClock()
    grabber = ReplayGrabber(frames(tmp_path), pace="real", clock=clock)
    grabber.open()
    with grabber.dequeue(1.0):
        pass
    for expected in (0, 0, 2):
        with grabber.dequeue(0.015) as fields:
            assert len(fields) == expected


def test_at_real_pace_it_says_whether_a_frame_was_due_when_it_was_asked(tmp_path):
    clock = StandingClock()
    grabber = ReplayGrabber(frames(tmp_path), pace="real", clock=clock)
    grabber.open()
    found = []
    for late_s in (0.0, 0.0, 0.1):
        clock.sleep(late_s)
        with grabber.dequeue(1.0) as fields:
            assert fields
        found.append(grabber.found_empty)
    assert found == [False, True, False]


def test_a_free_recording_waits_for_its_reader(tmp_path):
    assert ReplayGrabber(frames(tmp_path)).open().waits_for_reader


# --- open and close ---


def test_it_can_be_played_again_from_the_beginning(tmp_path):
    grabber = ReplayGrabber(frames(tmp_path, 1))
    for _ in range(2):
        grabber.open()
        with grabber.dequeue(0) as fields:
            assert fields[0].time_ns == 0
        with pytest.raises(StreamEnded), grabber.dequeue(0):
            pass


def test_it_delivers_nothing_while_it_is_closed(tmp_path):
    grabber = ReplayGrabber(frames(tmp_path, 1))
    with pytest.raises(DeviceLost, match="not open"), grabber.dequeue(0):
        pass
    grabber.open()
    grabber.close()
    grabber.close()
    with pytest.raises(DeviceLost), grabber.dequeue(0):
        pass


def test_it_knows_of_no_signal(tmp_path):
    grabber = ReplayGrabber(frames(tmp_path, 1))
    assert not grabber.open().tells_signal
    assert grabber.signal() is Signal.UNKNOWN


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"path": 12}, "path is the name of a file or folder, not 12"),
        ({"rate_hz": "yes"}, "rate_hz is the number of fields a second, not 'yes'"),
        ({"rate_hz": [50]}, "rate_hz is the number of fields a second"),
        ({"rate_hz": float("inf")}, "rate_hz is the number of fields a second"),
        ({"bits": "10"}, "bits is one of 8, 10, 12, 14, 16, not '10'"),
    ],
)
def test_options_of_another_kind_are_refused_by_name(tmp_path, options, said):
    with pytest.raises(ValueError, match=said):
        ReplayGrabber(**{"path": tmp_path, **options})
