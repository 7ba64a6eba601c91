"""A mutant's tests in a process of its own, forked from one that has imported what the source imports.

The program itself is imported anew in each of them, with the mutated module in place of the source's; so is
it in the Python processes that a test starts.
"""

import ast
import gc
import importlib
import json
import marshal
import os
import resource
import select
import shutil
import signal
import tempfile
import time
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from types import CodeType
from typing import NamedTuple

import pytest
from _pytest.config import default_plugins
from tests.house.source import ROOT, modules, tree

from .inherited import sitecustomize
from .mutant import KILLED, NO_TESTS, SURVIVED, TIMEOUT, UNFINISHED, Outcome

TEST_S = 60
"""For one test; pytest-timeout fails it then."""
BUSY_S, LONG_S = 20.0, 45.0
"""Processor time and time after which no further test begins."""
ALL_S = 90.0
"""Time for all tests of a mutant before their processes are killed."""
MEMORY = 8 << 30
"""Bytes of data: a loop that never ends may fill a list."""
PLUGINS = ("pytest_timeout", "_hypothesis_pytestplugin")
PRELOADED = (
    *(f"_pytest.{name}" for name in default_plugins),
    *(*PLUGINS, "hypothesis.strategies", "fastapi.testclient"),
)
OPTIONS = (
    *("-x", "-q", "--no-header", "-m", "not slow", "-p", "no:cacheprovider", "--timeout", str(TEST_S)),
    *("--disable-plugin-autoload", *(f"-p{name}" for name in PLUGINS)),
    *("-W", "ignore::pytest.PytestAssertRewriteWarning", "--hypothesis-seed=0"),
)
"""Plugins that are imported already need no assertions rewritten."""


def preload() -> None:
    """Imports what the modules of the source import from other packages; of the program itself nothing."""
    own = {name.partition(".")[0] for name in modules()}
    wanted = {name for path in modules().values() for name in _imported(tree(path))}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for name in (*PRELOADED, *sorted(wanted)):
            if name.partition(".")[0] not in own:
                with suppress(ImportError):
                    importlib.import_module(name)
    gc.collect()
    gc.freeze()


def _imported(module: ast.Module) -> Iterator[str]:
    for node in module.body:
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            yield node.module


def judged(codes: Mapping[str, CodeType], tests: Sequence[Path], unsound: Sequence[str] = ()) -> Outcome:
    """Judgement of the tests on mutated modules, which are given by their dotted names.

    Args:
        codes: The compiled modules.
        tests: Test files relative to the root, nearest first.
        unsound: Tests that fail without any mutant, and do not count.
    """
    with _folders(codes) as (folder, temporary):
        report = temporary / "report.json"
        pid = os.fork()
        if not pid:
            _child(folder, temporary, [*map(str, tests), *(f"--deselect={one}" for one in unsound)])
        ended, seconds = _waited(pid)
        seen = _Seen(**json.loads(report.read_text())) if report.exists() else _Seen(str(tests[0]))
    return _outcome(seen, ended)._replace(seconds=round(seconds, 1))


class _Seen(NamedTuple):
    """Report of the child, written before each test and at the end."""

    failed: str = ""
    late: bool = False
    passed: int = 0
    stopped: bool = False


def _outcome(seen: _Seen, ended: bool) -> Outcome:
    if not ended or seen.late:
        return Outcome(TIMEOUT, seen.failed)
    if seen.failed:
        return Outcome(KILLED, seen.failed)
    if seen.stopped:
        return Outcome(UNFINISHED)
    return Outcome(SURVIVED if seen.passed else NO_TESTS)


@contextmanager
def _folders(codes: Mapping[str, CodeType]) -> Iterator[tuple[Path, Path]]:
    temporary = Path(tempfile.mkdtemp(prefix="mutant-"))
    try:
        folder = temporary / "modules"
        folder.mkdir()
        for name, code in codes.items():
            (folder / name).write_bytes(marshal.dumps(code))
        yield folder, temporary
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def _waited(pid: int) -> tuple[bool, float]:
    """False if the child had to be killed, and its processor time; whatever it leaves behind is ended."""
    handle = os.pidfd_open(pid)
    ended = bool(select.select([handle], [], [], ALL_S)[0])
    with suppress(ProcessLookupError):
        os.killpg(pid, signal.SIGKILL)
    used = os.wait4(pid, 0)[2]
    os.close(handle)
    return ended, used.ru_utime + used.ru_stime


def _child(folder: Path, temporary: Path, tests: list[str]) -> None:
    """Runs the tests and never returns."""
    try:
        os.setsid()
        resource.setrlimit(resource.RLIMIT_DATA, (MEMORY, MEMORY))
        silent = os.open(os.devnull, os.O_RDWR)
        for stream in (0, 1, 2):
            os.dup2(silent, stream)
        os.chdir(ROOT)
        _install(folder)
        witness = _Witness(temporary / "report.json", tests[0])
        pytest.main([*OPTIONS, f"--basetemp={temporary / 't'}", *tests], plugins=[witness])
        witness.write()
    finally:
        os._exit(0)


def _install(folder: Path) -> None:
    os.environ[sitecustomize.VARIABLE] = str(folder)
    others = os.environ.get("PYTHONPATH")
    own = str(Path(sitecustomize.__file__).parent)
    os.environ["PYTHONPATH"] = os.pathsep.join([own, others] if others else [own])
    importlib.reload(sitecustomize)


class _Witness:
    """A plugin that keeps the first failure and stops when there is no time left."""

    def __init__(self, file: Path, first: str) -> None:
        self._file = file
        self._first = first
        self._began = time.monotonic()
        self._seen = _Seen()

    def pytest_runtest_logstart(self, nodeid: str) -> None:
        """Names the test in which the process may die or hang."""
        self.write(self._seen._replace(failed=self._seen.failed or nodeid))

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        if report.failed:
            self._fail(report.nodeid, report.longreprtext)

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.failed:
            self._fail(report.nodeid, report.longreprtext)
        elif report.when == "call" and report.passed:
            self._seen = self._seen._replace(passed=self._seen.passed + 1)

    def pytest_runtest_teardown(self, item: pytest.Item) -> None:
        if sum(os.times()[:4]) > BUSY_S or time.monotonic() - self._began > LONG_S:
            item.session.shouldstop = "no time left"
            self._seen = self._seen._replace(stopped=True)

    def pytest_sessionfinish(self, exitstatus: int) -> None:
        """Errors in pytest itself are those of a conftest, which a mutant may cause."""
        if exitstatus in (pytest.ExitCode.INTERNAL_ERROR, pytest.ExitCode.USAGE_ERROR):
            self._fail(self._first, "")

    def _fail(self, test: str, text: str) -> None:
        if not self._seen.failed:
            self._seen = self._seen._replace(failed=test or self._first, late=f"Timeout (>{TEST_S}" in text)

    def write(self, seen: _Seen | None = None) -> None:
        self._file.write_text(json.dumps((seen or self._seen)._asdict()))
