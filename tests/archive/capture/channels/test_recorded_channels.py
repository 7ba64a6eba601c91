"""Channels in a capture file: read as they were written, proved, and bounded."""

import json
import sqlite3
from contextlib import closing

import numpy as np
import pytest

from archive.captures import MADE_WITH, META, PERIOD_NS, START_NS, ledger_of, meta, points, slots, write
from archive.readings import CHANNELS, SIGMA_NS, STEP_NS, readings, write_with_channels
from grabberd.archive.capture.crash_recovery import recover
from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.capture.runs import append_run
from grabberd.archive.capture.schema import VERSION, WITH_CHANNELS, connect, format_of
from grabberd.archive.capture.verification import verify
from grabberd.archive.capture.writer import CaptureWriter
from grabberd.core.channels import Dating
from grabberd.core.channels.account import Account, ChannelAccount, ChannelLedger, Gap
from grabberd.errors import CaptureFileError, LaterVersion, NotFound, StorageError

FIELDS = 60
READINGS = FIELDS * PERIOD_NS // STEP_NS


@pytest.fixture
def capture(tmp_path):
    return write_with_channels(tmp_path, slots(FIELDS))


def change(path, *statements):
    with closing(sqlite3.connect(path, isolation_level=None)) as connection:
        for statement in statements:
            assert connection.execute(statement).rowcount > 0
    return path


def test_a_capture_without_channels_has_the_format_that_earlier_versions_read(tmp_path):
    with closing(connect(write(tmp_path, slots(3)))) as connection:
        assert format_of(connection) == VERSION
    with CaptureReader(tmp_path / "liner.grab") as reader:
        assert reader.channels.all == []
        assert reader.channels.account is None


def test_readings_come_back_as_they_were_written(capture):
    with CaptureReader(capture) as reader:
        assert tuple(reader.channels.all) == CHANNELS
        found = reader.channels.read("pulsation")
        first_ns = reader.first_time_ns
    expected = readings(0, READINGS)
    np.testing.assert_array_equal(found.time_ns, expected.time_ns)
    np.testing.assert_array_equal(found.value, expected.value)
    assert found.datings == (Dating.OWN_CLOCK,)
    assert set(found.time_sigma_ns) == {SIGMA_NS}
    np.testing.assert_allclose(found.time_s, (expected.time_ns - first_ns) / 1e9)


def test_its_calibration_turns_values_into_kpa(capture):
    with CaptureReader(capture) as reader:
        calibrated, raw = reader.channels.read("pulsation"), reader.channels.read("liner")
    np.testing.assert_allclose(calibrated.kpa, 101.3 - 0.1 * calibrated.value)
    assert set(calibrated.sigma_kpa) == {0.2}
    np.testing.assert_array_equal(raw.kpa, raw.value)
    assert set(raw.sigma_kpa) == {0.1}


def test_a_channel_that_is_not_there_is_told_with_those_that_are(capture):
    with CaptureReader(capture) as reader, pytest.raises(NotFound) as raised:
        reader.channels.read("mouthpiece")
    assert raised.value.hint == "its channels are: pulsation, liner"


def test_readings_that_are_dated_otherwise_are_kept_apart(tmp_path):
    writer = CaptureWriter.create(tmp_path / "liner.grab.part", meta(), channels=CHANNELS)
    writer.append(slots(25))
    for first, dating in ((0, Dating.ARRIVAL), (10, Dating.OWN_CLOCK), (20, Dating.OWN_CLOCK)):
        writer.append_readings(0, readings(first, 10, dating))
    writer.commit()
    with CaptureReader(writer.path) as reader:
        groups = list(reader.channels.groups(CHANNELS[0]))
        found = reader.channels.read("pulsation")
    writer.close()
    assert [(one.dating, len(one.time_ns)) for one in groups] == [
        (Dating.ARRIVAL, 10),
        (Dating.OWN_CLOCK, 20),
    ]
    np.testing.assert_array_equal(found.value, readings(0, 30).value)


def test_the_account_is_from_the_first_field_to_the_last(capture):
    with CaptureReader(capture) as reader:
        account = reader.channels.account
    assert account.in_words == "complete"
    assert [(one.name, one.logger, one.readings) for one in account.channels] == [
        ("pulsation", "tank", READINGS),
        ("liner", "tank", READINGS),
    ]


def test_a_capture_with_channels_is_verified_whole(capture):
    found = verify(capture)
    assert (found.fields, found.readings, found.damages) == (FIELDS, 2 * READINGS, [])


@pytest.mark.parametrize(
    "statement",
    [
        "UPDATE readings SET value = zeroblob(length(value)) WHERE channel = 1 AND number = 1",
        "UPDATE readings SET time_sigma_ns = time_sigma_ns + 1 WHERE channel = 1 AND number = 1",
        "UPDATE readings SET first_ns = first_ns + 1 WHERE channel = 1 AND number = 1",
        "UPDATE readings SET dating = 'arrival' WHERE channel = 1 AND number = 1",
        "DELETE FROM readings WHERE channel = 1 AND number = 1",
    ],
)
def test_a_changed_group_of_readings_is_found_and_the_others_are_read(capture, statement):
    change(capture, statement)
    damages = verify(capture).damages
    assert len(damages) == 1
    assert damages[0].startswith("readings of liner, group 1: ")
    with CaptureReader(capture) as reader:
        assert len(reader.channels.read("pulsation").value) == READINGS
        with pytest.raises(CaptureFileError, match="readings of liner, group 1"):
            reader.channels.read("liner")
    left_out = []
    with CaptureReader(capture, left_out) as reader:
        assert len(reader.channels.read("liner").value) == READINGS - 100
    assert [(one.what, one.n) for one in left_out] == [("readings of liner", 1)]


@pytest.mark.parametrize(
    "statement",
    [
        """UPDATE channels SET calibration = replace(calibration, '-0.1', '-0.2') WHERE channel = 0""",
        "UPDATE channels SET name = 'mouthpiece' WHERE channel = 1",
        "DELETE FROM channels WHERE channel = 1",
    ],
)
def test_a_changed_calibration_is_not_used(capture, statement):
    change(capture, statement)
    assert "its channels: it is not what was written: its digest differs" in verify(capture).damages
    with CaptureReader(capture) as reader, pytest.raises(CaptureFileError, match="its channels"):
        reader.check_unchanged()


@pytest.mark.parametrize(
    "statement",
    [
        "UPDATE channels SET calibration = '{}'",
        """UPDATE channels SET calibration = replace(calibration, '"gain": -0.1', '"gain": 0')""",
        """UPDATE channels SET calibration = replace(calibration, '"gain": -0.1', '"gain": 1e999')""",
        "UPDATE channels SET source = '7'",
        "UPDATE channels SET quantity = 'milk'",
        "UPDATE channels SET name = ''",
        "UPDATE channels SET name = char(10)",
        "UPDATE channels SET name = 'pulsation'",
        "UPDATE channels SET channel = 999 WHERE channel = 1",
    ],
)
def test_a_hostile_channel_is_refused(capture, statement):
    change(capture, statement)
    with CaptureReader(capture) as reader, pytest.raises(CaptureFileError):
        _ = reader.channels.all


@pytest.mark.parametrize(
    "statement",
    [
        "UPDATE readings SET readings = 1 << 40",
        "UPDATE readings SET readings = 0",
        "UPDATE readings SET readings = 'many'",
        "UPDATE readings SET time_ns = zeroblob(60000000)",
        "UPDATE readings SET value = 'text'",
        "UPDATE readings SET dating = 'by guess'",
        "UPDATE readings SET time_sigma_ns = -1",
        "UPDATE readings SET time_sigma_ns = 0.5",
        "UPDATE readings SET first_ns = 0",
        "UPDATE readings SET number = number + (1 << 33)",
    ],
)
def test_hostile_readings_are_refused_without_a_digest_that_would_tell(capture, statement):
    change(capture, statement, "DELETE FROM meta WHERE key = 'digests'")
    with CaptureReader(capture) as reader, pytest.raises(CaptureFileError):
        reader.channels.read("pulsation")


def test_groups_that_overlap_in_time_are_refused(capture):
    change(
        capture,
        "UPDATE readings SET (first_ns, last_ns, time_ns) = (SELECT first_ns, last_ns, time_ns FROM readings"
        " WHERE channel = 0 AND number = 0) WHERE channel = 0 AND number = 1",
        "DELETE FROM meta WHERE key = 'digests'",
    )
    with CaptureReader(capture) as reader, pytest.raises(CaptureFileError, match="do not ascend"):
        reader.channels.read("pulsation")


@pytest.mark.parametrize(
    "account",
    [
        {},
        {"channels": [{"name": "pulsation"}]},
        {"channels": [], "anomalies": [{"logger": "tank", "reason": "x" * 300}]},
        {"channels": [{"gaps": [[1, 2]] * 500}]},
    ],
)
def test_a_hostile_account_is_refused(capture, account):
    change(capture, f"UPDATE meta SET value = '{json.dumps(account)}' WHERE key = 'channels'")
    with CaptureReader(capture) as reader, pytest.raises(CaptureFileError):
        _ = reader.channels.account


def test_a_run_may_be_added_to_a_capture_with_channels(capture):
    append_run(capture, "measure", META.created_utc, "0.1.0", MADE_WITH, ((n, points(n)) for n in range(9)))
    assert verify(capture).damages == []


def test_what_a_crash_left_is_sealed_with_the_readings_that_are_in_it(tmp_path):
    part = write_with_channels(tmp_path, slots(FIELDS), sealed=False)
    change(part, "DELETE FROM readings WHERE number = 2 AND channel = 1")
    with CaptureReader(recover(part)) as reader:
        pulsation, liner = reader.channels.account.channels
        last_ns = reader.last_field[1]
    assert (pulsation.readings, pulsation.gap_count) == (READINGS, 0)
    assert liner.readings == READINGS - 40
    assert liner.gaps == (Gap(START_NS + 199 * STEP_NS, last_ns, "not written to disk"),)


def test_a_crash_before_the_first_reading_leaves_channels_with_nothing_in_them(tmp_path):
    writer = CaptureWriter.create(tmp_path / "liner.grab.part", meta(), channels=CHANNELS)
    writer.close()
    with CaptureReader(recover(writer.path)) as reader:
        assert reader.channels.account.in_words.startswith(
            "with gaps: pulsation: no readings at all (no reading came); liner: no readings"
        )


def test_channels_that_do_not_come_back_are_an_error_of_the_commit(tmp_path):
    writer = CaptureWriter.create(tmp_path / "liner.grab.part", meta(), channels=CHANNELS)
    writer._connection.execute(
        "CREATE TEMP TRIGGER spoilt AFTER INSERT ON main.readings BEGIN"
        " UPDATE readings SET value = substr(value, 1, 8) WHERE number = NEW.number; END"
    )
    writer.append_readings(0, readings(0, 10))
    with pytest.raises(StorageError, match="group 0 of the readings of channel 0 differs"):
        writer.commit()
    writer.close()


def test_readings_that_end_before_the_fields_are_a_gap_and_the_fields_are_complete(tmp_path):
    taken = slots(100)
    writer = CaptureWriter.create(tmp_path / "liner.grab.part", meta(), channels=CHANNELS[:1])
    writer.append(taken)
    part = readings(0, 100)
    writer.append_readings(0, part)
    ledger = ChannelLedger(ChannelAccount("pulsation", "tank"))
    ledger.enter(part.time_ns)
    ledger.interrupted("unplugged")
    writer.keep_account(Account((ledger.account,)))
    path = writer.seal(ledger_of(taken), complete=True, ended_because="length reached")
    with CaptureReader(path) as reader:
        (gap,) = reader.channels.account.channels[0].gaps
        assert reader.meta.complete
    assert gap == Gap(START_NS + 99 * STEP_NS, taken[-1].time_ns, "unplugged")


def test_a_version_beyond_those_known_is_left_alone(capture):
    with closing(sqlite3.connect(capture)) as connection:
        connection.execute(f"PRAGMA user_version = {WITH_CHANNELS + 1}")
    with pytest.raises(LaterVersion, match="reads up to 3"):
        CaptureReader(capture)
