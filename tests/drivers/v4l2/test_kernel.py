"""The real system calls, on files and pipes instead of a device."""

import errno
import os
from pathlib import Path

import pytest

from grabberd_v4l2 import abi
from grabberd_v4l2.node import POLL_HUP, POLL_IN, LinuxKernel

PAGE = os.sysconf("SC_PAGE_SIZE")
KERNEL = LinuxKernel()


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "buffer"
    path.write_bytes(b"\1" * PAGE + b"\2" * PAGE)
    return path


@pytest.fixture
def fd(file):
    opened = KERNEL.open(file)
    yield opened
    KERNEL.close(opened)


def mappings_of(file):
    return Path("/proc/self/maps").read_text().count(str(file))


def test_a_descriptor_never_blocks_and_is_not_inherited(fd):
    assert not os.get_blocking(fd)
    assert not os.get_inheritable(fd)


def test_a_buffer_is_seen_from_its_place_on(fd):
    pages = KERNEL.mmap(fd, PAGE, PAGE)
    assert pages.array.shape == (PAGE,)
    assert set(pages.array.tolist()) == {2}
    pages.unmap()


def test_a_buffer_shows_what_is_written_to_it(fd):
    pages = KERNEL.mmap(fd, PAGE, 0)
    os.pwrite(fd, b"\7", 5)
    assert pages.array[5] == 7
    pages.unmap()


def test_a_buffer_cannot_be_written_to_by_mistake(fd):
    pages = KERNEL.mmap(fd, PAGE, 0)
    with pytest.raises(ValueError, match="read-only"):
        pages.array[0] = 1
    pages.unmap()


def test_unmapping_releases_the_device_although_somebody_kept_a_view(fd, file):
    pages = KERNEL.mmap(fd, PAGE, 0)
    kept = pages.array.reshape(-1, 64)[::2]
    assert mappings_of(file) == 1
    pages.unmap()
    assert mappings_of(file) == 0
    assert not kept.any()


def test_the_place_of_a_buffer_is_free_when_the_last_view_is_gone(fd):
    pages = KERNEL.mmap(fd, 1024 * PAGE, 0)
    address = pages.array.ctypes.data
    kept = pages.array[:PAGE]
    pages.unmap()
    here = f"{address:x}-"
    assert here in Path("/proc/self/maps").read_text()
    del kept, pages
    assert here not in Path("/proc/self/maps").read_text()


def test_a_buffer_can_be_unmapped_twice_and_is_then_not_to_be_had(fd):
    pages = KERNEL.mmap(fd, PAGE, 0)
    pages.unmap()
    pages.unmap()
    with pytest.raises(ValueError, match="not mapped"):
        _ = pages.array


def test_what_cannot_be_mapped_is_an_error_of_the_system(fd):
    with pytest.raises(OSError, match="Invalid") as caught:
        KERNEL.mmap(fd, PAGE, 1)
    assert caught.value.errno == errno.EINVAL


def test_a_call_on_what_is_no_device_is_refused(fd):
    with pytest.raises(OSError, match="ioctl") as caught:
        KERNEL.ioctl(fd, abi.QUERYCAP, abi.Capability())
    assert caught.value.errno == errno.ENOTTY


def test_polling_tells_what_is_ready_and_gives_up_in_time():
    reader, writer = os.pipe()
    assert KERNEL.poll(reader, 0.0) == 0
    os.write(writer, b"x")
    assert KERNEL.poll(reader, 1.0) == POLL_IN
    os.read(reader, 1)
    os.close(writer)
    assert KERNEL.poll(reader, 1.0) == POLL_HUP
    os.close(reader)


def test_its_clock_runs_and_its_sleep_waits():
    before_ns = KERNEL.now_ns()
    KERNEL.sleep(0.002)
    assert KERNEL.now_ns() - before_ns >= 2_000_000
