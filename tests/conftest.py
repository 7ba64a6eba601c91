"""What tests need on computers that do other work as well: no test may fail because its computer is busy.

Arithmetic runs on one thread: beside other work, two that wait for each other take up to ten times as long.
Hypothesis does not judge by the clock how long examples take to draw and to run. Whoever is started in the
background by a script is told to ignore Ctrl-C, and passes that on: tests that press it have it heard again.
How long each file's tests take is kept for `make test-affected`. Services show recorded pictures in the rooms
where these are not the subject.
"""

import ctypes
import gc
import os
import signal
import sys
from collections.abc import Iterator
from functools import _lru_cache_wrapper
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from hypothesis import HealthCheck, settings

from affected.durations import Durations

if TYPE_CHECKING:
    from grabberd.work.process import Processes

HERE = Path(__file__).parent
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
settings.register_profile("shared", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("shared")
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
LONGEST = ("browser/", "proofs/faults/")
"""Rooms whose few tests take longest; begun last, they would keep a single processor at work at the end."""

SERVED = (
    *("archive/", "cli/", "drivers/mqtt/", "drivers/reprocess/", "instrument/"),
    *("library/", "liner/", "server/", "work/"),
)
"""Rooms of whole services and their captures."""
SUBJECT = ("cli/test_field_order.py", "cli/test_reversed_fields.py")
"""Files in them whose subject is what moves from picture to picture."""


@pytest.fixture(scope="module", autouse=True)
def pictures_drawn_once(request: pytest.FixtureRequest) -> Iterator[None]:
    """Drawing would take most of the processor's time in these rooms."""
    with pytest.MonkeyPatch.context() as patch:
        file = request.path.relative_to(HERE)
        if file.as_posix().startswith(SERVED) and file.as_posix() not in SUBJECT:
            from recorded_world import world_of  # noqa: PLC0415 - after the environment is set

            patch.setattr("grabberd_fake.grabber.World", world_of)
            patch.setattr("grabberd_fake.grabber.DrawnAhead", world_of)
        yield


@pytest.fixture
def importable(monkeypatch: pytest.MonkeyPatch) -> None:
    """Processes that a test starts find its modules."""
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(map(str, (HERE.parent, HERE, HERE / "support"))))


@pytest.fixture
def processes(importable: None) -> "Iterator[Processes]":
    """Those of one test."""
    from grabberd.work.process import Processes  # noqa: PLC0415 - after the environment is set

    own = Processes()
    yield own
    own.end()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The order is otherwise that of the files, which `--no-loadscope-reorder` keeps among the workers."""
    items.sort(key=lambda item: not item.path.relative_to(HERE).as_posix().startswith(LONGEST))


def pytest_collection_finish() -> None:
    """Twelve thousand tests and all modules are looked through for garbage once, and never again."""
    gc.collect()
    gc.freeze()


@pytest.hookimpl(trylast=True)
def pytest_runtest_teardown(item: pytest.Item, nextitem: pytest.Item | None) -> None:
    """Lets go of what refers to itself: a picture is a single object to the collector, which would wait for
    thousands of them. What has outlived a few collections goes with the last test of its file.
    """
    if nextitem and nextitem.path == item.path:
        gc.collect(1)
        return
    if not nextitem or nextitem.path.parent != item.path.parent:
        _forget()
    gc.collect(2)
    _trim()


def _forget() -> None:
    """Pictures and what is measured in them, which the tests' modules keep, serve the files of one folder."""
    folder = str(HERE)
    for module in list(sys.modules.values()):
        if (getattr(module, "__file__", None) or "").startswith(folder):
            for value in list(vars(module).values()):
                if isinstance(value, _lru_cache_wrapper):
                    value.cache_clear()


def _trim() -> None:
    """Gives back what the C library keeps of memory that is free."""
    if trim := getattr(ctypes.CDLL(None), "malloc_trim", None):
        trim(0)


def pytest_configure(config: pytest.Config) -> None:
    """Reports reach one process alone, which is none of the workers; without a cache nothing can be kept."""
    if not hasattr(config, "workerinput") and config.pluginmanager.hasplugin("cacheprovider"):
        config.pluginmanager.register(Durations(config))
