"""What is whole of a capture whose file lacks its end is saved, and the rest is lost in its ledger."""

import shutil
from itertools import pairwise

import pytest

from archive.captures import MADE_WITH, META, START_NS, ledger_of, meta, points, slot, slots
from archive.readings import CHANNELS, readings
from grabberd.archive.capture.crash_recovery import reason_of, recover, save_whole, seal, set_aside
from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.capture.schema import DAMAGED
from grabberd.archive.capture.verification import verify
from grabberd.archive.capture.writer import CaptureWriter
from grabberd.core.channels.account import Account, ChannelAccount, ChannelLedger
from grabberd.core.ledger import FILE_DAMAGED, LossCause, Outcome, cause_of_loss
from grabberd.errors import CaptureFileError
from grabberd.runtime import Now

FIELDS, A_COMMIT, A_FIELD = 600, 25, 4
PAGE = 4096
TAIL = 65536


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A capture of 12 s with points and readings: its file before it was sealed, and after that."""
    folder = tmp_path_factory.mktemp("made")
    writer = CaptureWriter.create(folder / "liner.grab.part", meta(bits=8), channels=CHANNELS[:1])
    kept = ChannelLedger(ChannelAccount("pulsation", "tank"))
    writer.begin_run(1, "live", META.created_utc, "0.1.0", MADE_WITH)
    taken = [one for one in slots(FIELDS, bits=8) if one.n not in range(100, 103)]
    taken[100] = slot(103, lost=3, bits=8)
    for one in taken:
        writer.append([one])
        writer.append_points(1, one.n, points(one.n))
        part = readings(one.n * A_FIELD, A_FIELD)
        writer.append_readings(0, part)
        kept.enter(part.time_ns)
        if one.n % A_COMMIT == A_COMMIT - 1:
            writer.keep_account(Account((kept.account,)))
            writer.commit()
    part = shutil.copy(writer.path, folder / "recording")
    ledger = ledger_of(taken)
    return part, writer.seal(ledger, complete=ledger.complete, ended_because="length reached")


def cut(file, path, lacking):
    """A copy of a file without its last bytes."""
    path.write_bytes(file.read_bytes()[:-lacking])
    return path


def saved(sealed, tmp_path, lacking):
    return save_whole(set_aside(cut(sealed, tmp_path / "liner.grab", lacking), "cut off"))


@pytest.mark.parametrize("lacking", [1, TAIL, 3 * TAIL, 8 * TAIL])
def test_a_sealed_capture_without_its_end_is_saved_up_to_the_cut(made, tmp_path, lacking):
    path = saved(made[1], tmp_path, lacking)
    assert path == tmp_path / "liner.grab"
    assert verify(path).damages == []
    with CaptureReader(path) as reader, CaptureReader(made[1]) as before:
        kept = {one.numbered.n: one for one in reader.fields()}
        for one in before.fields():
            if one.numbered.n in kept:
                same = kept[one.numbered.n]
                assert same.numbered.packed.data.tobytes() == one.numbered.packed.data.tobytes()
                assert same.numbered.time_ns == one.numbered.time_ns
        assert len(kept) >= FIELDS - 3 - FIELDS * 2 * lacking / made[1].stat().st_size - 3 * A_COMMIT
        assert reader.meta.state == "sealed"
        assert reader.meta.ended_because in ("length reached", FILE_DAMAGED)


@pytest.mark.parametrize("lacking", [TAIL, 4 * TAIL])
def test_its_ledger_has_what_is_missing_and_says_that_more_may_be(made, tmp_path, lacking):
    with CaptureReader(saved(made[1], tmp_path, lacking)) as reader:
        ledger, kept = reader.ledger, reader.field_count
        assert (reader.meta.complete, ledger.received) == (False, kept)
        last, unknown = ledger.entries[-2:]
        assert (last.outcome, last.reason) == (Outcome.LOST, FILE_DAMAGED)
        assert (unknown.count, unknown.reason) == (1, f"{FILE_DAMAGED}; unknown")
        assert unknown.end_n <= FIELDS + 1
        assert all(
            one.end_n == other.first_n or one.end_n < other.first_n for one, other in pairwise(ledger.entries)
        )
        assert ledger.entries[0].reason == "time gap"
        assert ledger.total == kept + sum(entry.count for entry in ledger.entries)
        assert cause_of_loss(last.outcome, last.reason) is LossCause.DISK


def test_its_points_and_readings_are_those_of_before_and_their_accounts_say_what_is_missing(made, tmp_path):
    with CaptureReader(saved(made[1], tmp_path, 3 * TAIL)) as reader:
        found = dict(reader.points(1))
        assert all(found[n].xyz_mm.tobytes() == points(n).xyz_mm.tobytes() for n in found)
        assert reader.run(1).state == "failed"
        assert reader.run(1).reason == FILE_DAMAGED
        (account,) = reader.channels.account.channels
        value = reader.channels.read("pulsation").value
        assert account.readings == len(value) < (FIELDS - 3) * A_FIELD
        assert account.silence == FILE_DAMAGED


def test_the_damaged_file_stays_and_says_where_the_rest_is(made, tmp_path):
    path = cut(made[1], tmp_path / "liner.grab", TAIL)
    content = path.read_bytes()
    aside = set_aside(path, "cut off")
    saved = save_whole(aside)
    assert aside.read_bytes() == content
    with CaptureReader(saved) as reader:
        words = f"what is whole of it is in liner.grab: {reader.field_count} fields"
    assert reason_of(aside).read_text().splitlines() == ["cut off", words]


def test_nothing_takes_the_place_of_another_capture(made, tmp_path):
    aside = set_aside(cut(made[1], tmp_path / "liner.grab", TAIL), "cut off")
    (tmp_path / "liner.grab").write_bytes(b"another")
    assert save_whole(aside) is None
    assert (tmp_path / "liner.grab").read_bytes() == b"another"


@pytest.mark.parametrize("lacking", [TAIL, 8 * TAIL])
def test_a_capture_that_was_cut_while_it_was_recorded_is_sealed_as_after_a_crash(made, tmp_path, lacking):
    part = cut(made[0], tmp_path / "liner.grab.part", lacking)
    now = Now(START_NS + 20 * 10**9, META.created_utc, META.boot_id)
    path = recover(part, now)
    assert path == tmp_path / "liner.grab"
    assert verify(path).damages == []
    assert (tmp_path / DAMAGED / "liner.grab.part").exists()
    with CaptureReader(path) as reader:
        assert reader.field_count > 0
        reasons = [entry.reason.partition(";")[0] for entry in reader.ledger.entries]
        assert reasons[-2:] == [FILE_DAMAGED, "the program ended while it was recording"]
        assert reader.ledger.entries[-1].reason.endswith(str(1000 + 1 - reader.ledger.entries[-1].first_n))


def test_by_command_the_damaged_file_stays_in_its_hidden_folder(made, tmp_path):
    hidden = tmp_path / ".grabberd-x"
    hidden.mkdir()
    assert seal(cut(made[0], hidden / "liner.grab.part", TAIL)) == tmp_path / "liner.grab"
    assert (hidden / DAMAGED / "liner.grab.part").exists()


@pytest.mark.parametrize("left", [0, 10, PAGE, 2 * PAGE])
def test_a_file_of_which_nothing_is_left_is_set_aside_alone(made, tmp_path, left):
    part = tmp_path / "liner.grab.part"
    part.write_bytes(made[0].read_bytes()[:left])
    assert recover(part) == tmp_path / DAMAGED / "liner.grab.part"
    assert not list(tmp_path.glob("*.grab*"))


def test_pages_that_are_gone_amid_the_file_cost_their_groups_alone(made, tmp_path):
    content = bytearray(made[1].read_bytes())
    for place in range(len(content) // 2, len(content) // 2 + 2 * PAGE):
        content[place] = 0xA5
    path = tmp_path / "liner.grab"
    path.write_bytes(content[:-TAIL])
    whole = save_whole(set_aside(path, "cut off"))
    assert verify(whole).damages == []
    with CaptureReader(whole) as reader:
        assert reader.field_count > FIELDS // 2


def test_a_sealed_capture_that_can_be_opened_has_nothing_to_be_saved(made, tmp_path):
    path = tmp_path / "liner.grab"
    shutil.copy(made[1], path)
    with pytest.raises(CaptureFileError, match="interrupted"):
        seal(path)
