"""How long captures are kept: by age and by free space, oldest first, and never what has to stay."""

import logging
import os
import sqlite3
from contextlib import closing
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from queued_jobs import jobs_in
from running import configuration, until
from slots import ManualClock

from archive.captures import slots, write
from grabberd.archive.catalogue.archive import Archive, CaptureAnnotations
from grabberd.archive.catalogue.disk_guard import GB, Candidate, DiskGuard, Policy, Retention, removals
from grabberd.archive.state.state_database import Annotation, AnnotationStore, StateDatabase
from grabberd.config import RetentionConfig, StorageConfig, default_config_file
from grabberd.errors import Conflict, NotFound, StorageError
from grabberd.instrument.setup import set_up
from grabberd.library.jobs.measurement import MeasurementJob
from grabberd.server.daemon.service import Service
from grabberd_liner.analyses.store import AnalysisStore

NOW = datetime(2026, 1, 1, tzinfo=UTC)


def kept(days: float, size: int = 10, name: str | None = None) -> Candidate:
    return Candidate(name or f"{days:g} days", NOW - timedelta(days=days), size)


def ids(policy: Policy, captures: list[Candidate], free: int = 0) -> list[str]:
    return [removal.id for removal in removals(captures, policy, NOW, free)]


# --- what goes ---


def test_without_a_policy_nothing_goes() -> None:
    assert ids(Policy(), [kept(10_000)]) == []
    assert not Policy.from_config(RetentionConfig()).removes


def test_what_is_older_than_the_days_goes_oldest_first() -> None:
    assert ids(Policy(keep_days=30), [kept(31), kept(29), kept(90), kept(30)]) == ["90 days", "31 days"]


def test_the_oldest_go_until_enough_is_free_and_not_one_more() -> None:
    captures = [kept(1), kept(2), kept(3), kept(4)]
    policy = Policy(min_free_bytes=25)
    assert ids(policy, captures, free=25) == []
    assert ids(policy, captures, free=24) == ["4 days"]
    assert ids(policy, captures, free=10) == ["4 days", "3 days"]
    assert ids(policy, captures, free=0) == ["4 days", "3 days", "2 days"]


def test_what_goes_by_age_counts_as_room() -> None:
    assert ids(Policy(30, 15), [kept(40), kept(20), kept(10)], free=5) == ["40 days"]


def test_each_removal_says_why() -> None:
    found = removals([kept(40), kept(20)], Policy(30, 2 * GB), NOW, GB)
    assert [removal.because for removal in found] == ["older than 30 days", "less than 2 GB were free"]


@given(
    ages=st.lists(st.floats(0, 100), max_size=20),
    keep_days=st.none() | st.floats(1, 100),
    least=st.none() | st.integers(1, 300),
    free=st.integers(0, 300),
)
def test_only_what_the_policy_names_goes_and_no_younger_one_before_an_older(
    ages: list[float], keep_days: float | None, least: int | None, free: int
) -> None:
    captures = [kept(age, name=str(number)) for number, age in enumerate(ages)]
    found = removals(captures, Policy(keep_days, least), NOW, free)
    gone = {removal.id for removal in found}
    old = [
        one.id for one in captures if keep_days is not None and NOW - one.changed > timedelta(days=keep_days)
    ]
    assert set(old) <= gone
    stays = [one.changed for one in captures if one.id not in gone]
    assert all(one.changed <= min(stays, default=NOW) for one in captures if one.id in gone)
    if least is not None and stays:
        assert free + 10 * len(gone) >= least
    if len(gone) > len(old):
        assert least is not None
        assert free + 10 * (len(gone) - 1) < least


# --- its going ---


class Barn:
    """Captures of several ages, and what keeps them."""

    def __init__(self, folder: Path, days: tuple[int, ...], policy: Policy, free: int = 10 * GB) -> None:
        self.free = free
        self.archive = Archive(folder / "captures", list)
        self.archive.open()
        for day in days:
            self.put(day)
        self.archive.index.rebuild()
        StateDatabase(folder / "state.sqlite").open()
        self.annotations = AnnotationStore(folder / "state.sqlite")
        self.jobs = jobs_in(folder).queue
        self.analyses = AnalysisStore(folder / "analyses")
        self.analyses.open()
        self.keeping = CaptureAnnotations(self.archive, self.annotations, self.jobs, self.analyses.remove)
        disk = DiskGuard(0, lambda _: self.free)
        self.retention = Retention(
            self.archive, policy, disk, ManualClock(0), self.keeping.spared, self.keeping.delete
        )

    def put(self, day: int) -> Path:
        moment = NOW - timedelta(days=day)
        path = write(
            self.archive.directory, slots(2), name=f"d{day}", id=f"d{day}", created_utc=f"{moment:%FT%TZ}"
        )
        os.utime(path, (moment.timestamp(), moment.timestamp()))
        return path

    @property
    def files(self) -> set[str]:
        return {path.name.split(".")[0] for path in self.archive.directory.glob("*.grab*")}

    @property
    def listed(self) -> set[str]:
        return {entry.id for entry in self.archive.index.list()}


def test_captures_that_have_to_go_are_deleted_logged_and_counted(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    barn = Barn(tmp_path, (5, 40, 50), Policy(keep_days=30))
    sizes = sum((barn.archive.directory / f"d{day}.grab").stat().st_size for day in (40, 50))
    assert [removal.id for removal in barn.retention.apply()] == ["d50", "d40"]
    assert barn.files == barn.listed == {"d5"}
    assert (barn.retention.removed, barn.retention.removed_bytes) == (2, sizes)
    assert "capture d50 was removed" in caplog.text
    assert "older than 30 days" in caplog.text
    assert barn.retention.apply() == []


def test_pinned_captures_and_those_that_a_job_works_on_stay(tmp_path: Path) -> None:
    barn = Barn(tmp_path, (40, 50, 60), Policy(keep_days=30))
    barn.annotations.put("d60", Annotation(pinned=True))
    barn.jobs.submit(MeasurementJob(subject="d50", made_with={}))
    barn.retention.apply()
    assert barn.files == {"d50", "d60"}


def test_running_unsealed_and_damaged_ones_stay(tmp_path: Path) -> None:
    barn = Barn(tmp_path, (40, 50, 60), Policy(keep_days=30))
    folder = barn.archive.directory
    long_ago = (NOW - timedelta(days=50)).timestamp()
    (folder / "d50.grab").write_bytes(b"garbage")
    os.utime(folder / "d50.grab", (long_ago, long_ago))
    part = (folder / "d60.grab").rename(folder / "d60.grab.part")
    barn.archive.index.rebuild([part])
    barn.retention.apply()
    assert part.exists()
    assert (folder / "damaged" / "d50.grab").exists()
    assert barn.files == {"d60"}


def test_what_was_copied_here_lately_is_not_old(tmp_path: Path) -> None:
    barn = Barn(tmp_path, (40,), Policy(keep_days=30))
    os.utime(barn.archive.directory / "d40.grab", (NOW.timestamp(), NOW.timestamp()))
    assert barn.retention.apply() == []


def test_one_that_is_pinned_at_this_moment_stays_and_the_next_goes(tmp_path: Path) -> None:
    barn = Barn(tmp_path, (40, 50), Policy(keep_days=30))

    def refuse_one(capture_id: str) -> None:
        if capture_id == "d50":
            raise Conflict("it is pinned", "unpin it")
        barn.keeping.delete(capture_id)

    barn.retention._delete = refuse_one
    assert [removal.id for removal in barn.retention.apply()] == ["d40"]
    assert barn.files == {"d50"}


def test_where_pins_cannot_be_read_nothing_goes(tmp_path: Path) -> None:
    barn = Barn(tmp_path, (40,), Policy(keep_days=30))
    (tmp_path / "state.sqlite").write_bytes(b"garbage " * 1000)
    with pytest.raises(StorageError):
        barn.retention.apply()
    assert barn.files == {"d40"}


def test_what_was_made_lately_is_not_old_however_old_its_file_is_said_to_be(tmp_path: Path) -> None:
    barn = Barn(tmp_path, (5,), Policy(keep_days=30))
    long_ago = (NOW - timedelta(days=40)).timestamp()
    os.utime(barn.archive.directory / "d5.grab", (long_ago, long_ago))
    assert barn.retention.apply() == []


@pytest.mark.parametrize("created_utc", ["unknown", "2025-12-31T00:00:00"])
def test_one_whose_time_cannot_be_read_is_damaged_and_stays(tmp_path: Path, created_utc: str) -> None:
    barn = Barn(tmp_path, (), Policy(keep_days=30))
    written = (NOW - timedelta(days=40)).timestamp()
    path = write(barn.archive.directory, slots(2), name="odd", id="odd")
    with closing(sqlite3.connect(path)) as connection, connection:
        change = "UPDATE meta SET value = json_quote(?) WHERE key = 'created_utc'"
        connection.execute(change, (created_utc,))
    os.utime(path, (written, written))
    barn.archive.index.rebuild()
    assert barn.retention.apply() == []
    assert "created_utc" in barn.archive.index.get("odd").reason


def test_one_that_was_deleted_meanwhile_is_not_counted(tmp_path: Path) -> None:
    barn = Barn(tmp_path, (40,), Policy(keep_days=30))

    def gone(capture_id: str) -> None:
        raise NotFound(f"no capture {capture_id}", "")

    barn.retention._delete = gone
    assert barn.retention.apply() == []
    assert (barn.retention.removed, barn.retention.removed_bytes) == (0, 0)


def test_a_failure_that_lasts_is_logged_once_and_again_when_it_comes_back(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    barn = Barn(tmp_path, (40,), Policy(keep_days=30))
    results: list[Exception | None] = [
        StorageError("the disk says no", ""),
        StorageError("the disk says no", ""),
        OSError("input/output error"),
        None,
        OSError("input/output error"),
    ]

    class Rounds:
        """Stops after the last result; never waits."""

        def is_set(self) -> bool:
            return not results

        def wait(self, timeout_s: float) -> None:
            assert timeout_s == 60.0

    def fail(capture_id: str) -> None:
        error = results.pop(0)
        if error:
            raise error
        raise Conflict("it is pinned", "unpin it")

    barn.retention._delete = fail
    barn.retention._stopping = Rounds()  # type: ignore[assignment]
    barn.retention._run()
    failures = [one.getMessage() for one in caplog.records if one.levelno == logging.ERROR]
    assert failures == [
        "no capture can be removed: the disk says no",
        "no capture can be removed: input/output error",
        "no capture can be removed: input/output error",
    ]


def test_a_policy_in_gigabytes_keeps_as_many_bytes() -> None:
    assert Policy.from_config(RetentionConfig(min_free_gb=1.5)) == Policy(None, 1_500_000_000)
    assert Policy.from_config(RetentionConfig(keep_days=2)).removes
    assert Policy.from_config(RetentionConfig(min_free_gb=1.5)).removes


def test_a_short_disk_gets_its_room_from_the_oldest(tmp_path: Path) -> None:
    barn = Barn(tmp_path, (5, 40), Policy(min_free_bytes=GB), free=GB - 1)
    assert [removal.id for removal in barn.retention.apply()] == ["d40"]


def test_a_service_removes_by_itself_what_its_configuration_says(tmp_path: Path) -> None:
    barn = Barn(tmp_path, (5, 40), Policy())
    barn.archive.close()
    config = configuration({"pace": "free"})
    storage = StorageConfig(directory=tmp_path, retention=RetentionConfig(keep_days=30))
    service = Service.from_config(
        config.model_copy(update={"storage": storage}), set_up(config, default_config_file())
    )
    write(barn.archive.directory, slots(2), name="new", id="new", created_utc=f"{datetime.now(UTC):%FT%TZ}")
    service.start()
    try:
        until(lambda: service.retention.removed == 2)
        assert barn.files == {"new"}
        assert service.state().storage.removed == 2
    finally:
        service.stop()
