"""Every driver of a logger keeps what `grabberd.testing` asks of one."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from contract.loggers import BENCHES
from grabberd.instrument.acquisition import LOGGERS
from grabberd.testing import LoggerBench, LoggerContract


class TestEveryLogger(LoggerContract):
    @pytest.fixture(params=BENCHES)
    def bench(self, request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[LoggerBench]:
        made = BENCHES[request.param](tmp_path)
        yield made
        made.close()


@pytest.mark.parametrize("driver", LOGGERS.available())
def test_an_unknown_option_is_refused_by_name(driver: str) -> None:
    if driver == "mqtt":
        pytest.importorskip("paho", reason="pip install 'grabberd[mqtt]'")
    with pytest.raises(ValueError, match="no_such_option"):
        LOGGERS.create(driver, {"no_such_option": 1})
