"""Machines for the tests, booted once, one after the other, while the first tests run; tables of results."""

from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

import pytest

from proofs.vm.guest import unit
from proofs.vm.image import CHECKOUT, RELEASES, cached_image
from proofs.vm.installed import Installed
from proofs.vm.machine import Machine, Processor, concurrent, counted
from proofs.vm.tables import KERNEL, SYSTEMD, Tables

HERE = Path(__file__).parent
REFERENCE = CHECKOUT / "docs" / "reference"
RESULTS = REFERENCE / "real-kernel.md"
RESULTS_OF_SERVICE = REFERENCE / "real-systemd.md"
LIMIT_S = 900
"""Of one test, the image's building and a boot included; a call into the machine has a shorter limit."""

_MACHINES: dict[str, tuple[Callable[[], Processor], str]] = {
    "timed": (lambda: counted(1), RELEASES[0]),
    "fast": (lambda: counted(0), RELEASES[0]),
    "newer": (lambda: counted(0), RELEASES[1]),
    "concurrent": (concurrent, RELEASES[0]),
}
_tables = pytest.StashKey[Tables]()
_service_tables = pytest.StashKey[Tables]()


class Machines:
    """One of each kind, paused while nobody uses it; one that has died is booted anew."""

    def __init__(self) -> None:
        self._image = cached_image()
        self._booter = ThreadPoolExecutor(max_workers=1)
        self._booting: dict[str, Future[Machine]] = {}
        self._installer = ThreadPoolExecutor(max_workers=1)
        self._installing: Future[Installed] | None = None

    def expect_installed(self) -> None:
        """The service is installed beside whatever else is tested: it takes minutes, of another core."""
        if self._installing is None:
            self._installing = self._installer.submit(Installed, self._image)

    def installed(self) -> Installed:
        """The machine with the service, running."""
        self.expect_installed()
        assert self._installing is not None
        there = self._installing.result()
        if not there.machine.is_alive:
            there.boot()
        there.machine.resume()
        return there

    def expect(self, names: list[str]) -> None:
        """These will be needed, in this order."""
        for name in names:
            self._boot(name)

    def get(self, name: str) -> Machine:
        """The machine, running."""
        machine = self._boot(name).result()
        if not machine.is_alive:
            del self._booting[name]
            machine = self._boot(name).result()
        machine.resume()
        return machine

    def stop(self) -> None:
        """Kills all of them."""
        self._booter.shutdown(cancel_futures=True)
        for booting in self._booting.values():
            if not booting.cancelled() and booting.exception() is None:
                booting.result().stop()
        self._installer.shutdown()
        if self._installing is not None and self._installing.exception() is None:
            self._installing.result().close()

    def _boot(self, name: str) -> "Future[Machine]":
        if name not in self._booting:
            self._booting[name] = self._booter.submit(self._booted, name)
        return self._booting[name]

    def _booted(self, name: str) -> Machine:
        processor, release = _MACHINES[name]
        machine = Machine(self._image, processor(), release=release)
        machine.pause()
        return machine


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--write-tables", action="store_true", help=f"write the results into {REFERENCE}")


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line("markers", "vm: runs in a virtual machine, under a real kernel: make test-vm")
    config.stash[_tables] = Tables(KERNEL)
    config.stash[_service_tables] = Tables(SYSTEMD)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if item.path.is_relative_to(HERE):
            item.add_marker(pytest.mark.vm)
            item.add_marker(pytest.mark.timeout(LIMIT_S))


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    failed = terminalreporter.stats.get("failed") or terminalreporter.stats.get("error")
    for key, results in ((_tables, RESULTS), (_service_tables, RESULTS_OF_SERVICE)):
        tables = config.stash[key]
        for line in tables.lines():
            terminalreporter.write_line(line)
        if tables and config.getoption("--write-tables") and not failed:
            results.write_text(tables.document())


@pytest.fixture
def tables(pytestconfig: pytest.Config) -> Tables:
    """What is printed at the end of the run."""
    return pytestconfig.stash[_tables]


@pytest.fixture
def service_tables(pytestconfig: pytest.Config) -> Tables:
    """The same, of the installed service."""
    return pytestconfig.stash[_service_tables]


@pytest.fixture(scope="session")
def machines(request: pytest.FixtureRequest) -> Iterator[Machines]:
    """All of them; those that the collected tests name are booted ahead."""
    made = Machines()
    wanted = [name for item in request.session.items for name in _names(item)]
    if "installed" in wanted:
        made.expect_installed()
    made.expect([name for name in dict.fromkeys(wanted) if name in _MACHINES])
    yield made
    made.stop()


@pytest.fixture
def timed(machines: Machines) -> Iterator[Machine]:
    """A machine whose rates can be asserted."""
    yield from _lent(machines, "timed")


@pytest.fixture
def fast(machines: Machines) -> Iterator[Machine]:
    """The same with a processor twice as fast, for work that is heavy."""
    yield from _lent(machines, "fast")


@pytest.fixture
def newer(machines: Machines) -> Iterator[Machine]:
    """The same under Debian 13's kernel."""
    yield from _lent(machines, "newer")


@pytest.fixture
def concurrent_machine(machines: Machines) -> Iterator[Machine]:
    """A machine with two processors, of whose time nothing is known."""
    yield from _lent(machines, "concurrent")


@pytest.fixture
def installed(machines: Machines) -> Iterator[Installed]:
    """The machine on which the service is installed, running when it is lent."""
    there = machines.installed()
    yield there
    there.machine.pause()


@pytest.fixture
def service(installed: Installed) -> Machine:
    """The same, for tests that boot nothing: its service is ready, nothing is captured."""
    installed.machine.call(unit.until_ready, timeout_s=600)
    return installed.machine


def _names(item: pytest.Item) -> Iterator[str]:
    """Fixtures of a test, and words among its parameters, of which one may be a machine's name."""
    yield from getattr(item, "fixturenames", ())
    if hasattr(item, "callspec"):
        yield from (value for value in item.callspec.params.values() if isinstance(value, str))


def _lent(machines: Machines, name: str) -> Iterator[Machine]:
    machine = machines.get(name)
    yield machine
    machine.pause()
