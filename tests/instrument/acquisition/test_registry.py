"""Drivers are found by name, imported only when asked for."""

import sys

import pytest

from grabberd.errors import DriverMissing
from grabberd.instrument.acquisition import GRABBERS, LOGGERS

DRIVER = """
class Grabber:
    def __init__(self, path, gain=1):
        self.path, self.gain = path, gain
        if gain < 0:
            raise ValueError(f"gain must not be negative, not {gain}")
"""


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """A package with drivers, as an installer would leave it."""
    info = tmp_path / "barn_drivers-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: barn-drivers\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(
        "[grabberd.drivers]\n"
        "barn = barn_driver:Grabber\n"
        "needy = needy_driver:Grabber\n"
        "old = barn_driver:Gone\n"
        "[grabberd.loggers]\n"
        "gauge = barn_driver:Grabber\n"
    )
    (tmp_path / "barn_driver.py").write_text(DRIVER)
    (tmp_path / "needy_driver.py").write_text("import a_library_nobody_has\n")
    monkeypatch.syspath_prepend(tmp_path)
    yield
    sys.modules.pop("barn_driver", None)


@pytest.mark.usefixtures("installed")
def test_installed_drivers_are_listed_without_importing_them():
    assert {"barn", "needy", "old"} <= set(GRABBERS.available())
    assert "barn_driver" not in sys.modules


@pytest.mark.usefixtures("installed")
def test_a_driver_is_made_from_its_options():
    grabber = GRABBERS.create("barn", {"path": "/dev/video7", "gain": 3})
    assert (grabber.path, grabber.gain) == ("/dev/video7", 3)


@pytest.mark.usefixtures("installed")
def test_an_unknown_name_is_answered_with_those_that_are_there():
    with pytest.raises(DriverMissing, match=r"no driver 'brn'; installed are: .*barn") as caught:
        GRABBERS.create("brn", {})
    assert "grabberd.drivers" in caught.value.hint


@pytest.mark.usefixtures("installed")
def test_a_driver_that_lacks_a_library_says_what_to_install():
    with pytest.raises(DriverMissing, match="'needy' cannot be imported") as caught:
        GRABBERS.create("needy", {})
    assert "a_library_nobody_has" in caught.value.hint


@pytest.mark.usefixtures("installed")
def test_an_entry_that_points_nowhere_is_a_missing_driver():
    with pytest.raises(DriverMissing, match="not where its package says"):
        GRABBERS.create("old", {})


@pytest.mark.usefixtures("installed")
@pytest.mark.parametrize("options", [{"pth": "x"}, {}, {"path": "x", "colour": 1}])
def test_unknown_and_missing_options_are_refused_with_those_that_exist(options):
    with pytest.raises(ValueError, match=r"driver 'barn'.*options are: path, gain"):
        GRABBERS.create("barn", options)


@pytest.mark.usefixtures("installed")
def test_what_the_driver_says_of_a_value_is_passed_on():
    with pytest.raises(ValueError, match="gain must not be negative"):
        GRABBERS.create("barn", {"path": "x", "gain": -1})


@pytest.mark.usefixtures("installed")
def test_loggers_and_grabbers_are_kept_apart():
    assert LOGGERS.create("gauge", {"path": "/dev/ttyUSB0"}).path == "/dev/ttyUSB0"
    with pytest.raises(DriverMissing, match="no driver 'gauge'"):
        GRABBERS.create("gauge", {"path": "/dev/ttyUSB0"})
    with pytest.raises(DriverMissing, match="no driver 'barn'") as caught:
        LOGGERS.create("barn", {"path": "/dev/video0"})
    assert "grabberd.loggers" in caught.value.hint
