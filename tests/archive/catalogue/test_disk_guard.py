"""Room on the disk: checked before a capture, watched while it runs, shown as minutes."""

import errno
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from recording_rig import Rig, wait_until_written
from running import PATIENCE_S, configuration, sealed, wait_until_it_accepts
from slots import slot

from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.catalogue.disk_guard import GB, DiskGuard, bytes_per_field
from grabberd.config import default_config_file
from grabberd.errors import Cause, StorageError
from grabberd.instrument.capture.capture_request import CaptureRequest
from grabberd.instrument.setup import set_up
from grabberd.server.daemon.service import Service

EVERYWHERE = Path("/")


class Disk:
    """So much is free as the test says; read-only or gone when it says so."""

    def __init__(self, free: float) -> None:
        self.free = free

    def __call__(self, _: Path) -> int:
        if self.free < 0:
            raise OSError("no such device")
        return int(self.free)


@contextmanager
def service_with(folder: Path, disk: Disk, **options: object) -> Iterator[Service]:
    config = configuration({"pace": "free", **options})
    guard = DiskGuard(GB, disk)
    service = Service(set_up(config, default_config_file()), folder, disk=guard)
    service.start()
    try:
        wait_until_it_accepts(service)
        yield service
    finally:
        service.stop()


def test_the_reserve_does_not_count_as_room() -> None:
    guard = DiskGuard(GB, Disk(1.5 * GB))
    assert guard.seconds_left(EVERYWHERE, GB / 100) == pytest.approx(50)
    assert DiskGuard(2 * GB, Disk(1.5 * GB)).seconds_left(EVERYWHERE, 1.0) == 0


def test_a_capture_that_does_not_fit_is_refused_with_the_minutes_that_do() -> None:
    guard = DiskGuard(GB, Disk(1.6 * GB))
    guard.check_fits(EVERYWHERE, GB / 1000, 600.0)
    with pytest.raises(StorageError, match=r"room for 10\.0 minutes at this rate \(3\.6 GB/h\), 10\.1"):
        guard.check_fits(EVERYWHERE, GB / 1000, 606.0)


def test_a_capture_without_a_length_needs_room_for_a_minute() -> None:
    DiskGuard(0, Disk(GB)).check_fits(EVERYWHERE, GB / 60, None)
    with pytest.raises(StorageError, match=r"room for 0\.9 minutes"):
        DiskGuard(0, Disk(0.9 * GB)).check_fits(EVERYWHERE, GB / 60, None)


def test_a_disk_that_is_gone_is_a_storage_error() -> None:
    with pytest.raises(StorageError, match="no such device"):
        DiskGuard(0, Disk(-1)).shortage(EVERYWHERE)


def test_what_a_field_is_expected_to_take_grows_with_its_bits() -> None:
    sizes = [bytes_per_field(bits, 288, 720) for bits in (1, 2, 3, 4, 5, 6, 8)]
    assert sizes == sorted(sizes)
    assert sizes[0] < 12_000
    assert 120_000 < sizes[-1] < 150_000


def test_a_capture_that_fills_the_disk_ends_sealed_and_says_why(tmp_path: Path) -> None:
    disk = Disk(2 * GB)
    rig = Rig(tmp_path, None, 100, measured=False, disk=DiskGuard(GB, disk))
    rig.recording.start()
    rig.put(slot(0), slot(1))
    wait_until_written(rig, 2)
    disk.free = GB - 1
    rig.put(slot(2), slot(3))
    wait_until_written(rig, 4)
    with rig.sealed() as reader:
        assert reader.meta.complete is False
        assert reader.meta.ended_because is not None
        assert reader.meta.ended_because.startswith("disk nearly full: 1.00 GB are free")
        assert reader.ledger.received == 4


def test_a_disk_that_goes_away_ends_the_capture_and_not_the_program(tmp_path: Path) -> None:
    disk = Disk(2 * GB)
    rig = Rig(tmp_path, None, 100, measured=False, disk=DiskGuard(GB, disk))
    rig.recording.start()
    rig.put(slot(0))
    wait_until_written(rig, 1)
    disk.free = -1
    rig.put(slot(1))
    wait_until_written(rig, 2)
    assert rig.recording.sealed.wait(PATIENCE_S)
    assert rig.recording.failure is not None
    assert "no such device" in rig.recording.failure.message


def test_a_file_that_can_only_be_read_any_more_keeps_what_is_in_it(tmp_path: Path) -> None:
    rig = Rig(tmp_path, None, 100, measured=False)
    rig.recording.start()
    rig.put(slot(0), slot(1))
    wait_until_written(rig, 2)
    rig.recording._writer._connection.execute("PRAGMA query_only = ON")
    rig.put(slot(2))
    for _ in range(round(PATIENCE_S / 0.05)):  # time passes, so that it tries to commit
        rig.clock.advance(1.0)
        if rig.recording.sealed.wait(0.05):
            break
    assert isinstance(rig.recording.failure, StorageError)
    assert "readonly" in rig.recording.failure.message
    with CaptureReader(rig.recording.path) as reader:
        assert [numbered.n for numbered in reader.received()] == [0, 1]


def test_the_service_refuses_what_does_not_fit_and_goes_on(tmp_path: Path) -> None:
    disk = Disk(1.01 * GB)
    with service_with(tmp_path, disk) as service:
        with pytest.raises(StorageError, match="minutes at this rate"):
            service.capture_control.start(None, CaptureRequest(fields=100_000, bits=8))
        assert not list(service.archive.directory.glob("*.grab*"))
        service.capture_control.start(None, CaptureRequest(fields=20))
        assert sealed(service).complete


def test_the_state_says_how_many_minutes_are_left(tmp_path: Path) -> None:
    disk = Disk(3 * GB)
    with service_with(tmp_path, disk) as service:
        storage = service.state().storage
        per_minute = 60 * service.instrument(None).captures.bytes_per_s
        assert storage.free_bytes == 3 * GB
        assert storage.minutes_left == pytest.approx(2 * GB / per_minute, abs=0.1)
        disk.free = -1
        assert service.state().storage.minutes_left is None
        assert "no such device" in service.state().storage.problem
        assert service.state().storage.cause_code == Cause.DISK_FAILED


def test_a_disk_that_is_away_or_read_only_says_which(tmp_path: Path) -> None:
    def free_of(number: int) -> Callable[[Path], int]:
        def free(folder: Path) -> int:
            raise OSError(number, os.strerror(number), str(folder))

        return free

    for number, code in ((errno.ENOENT, Cause.DISK_MISSING), (errno.EROFS, Cause.DISK_READ_ONLY)):
        assert DiskGuard(free=free_of(number)).document(tmp_path, 1.0).cause_code == code


def test_a_running_capture_is_judged_by_what_it_really_writes(tmp_path: Path) -> None:
    with service_with(tmp_path, Disk(3 * GB)) as service:
        service.capture_control.start(None, CaptureRequest(fields=100))
        recording = sealed(service)
        assert recording.bytes_per_field is not None
        expected = bytes_per_field(1, 576, 720)
        assert expected / 3 < recording.bytes_per_field < expected * 3
