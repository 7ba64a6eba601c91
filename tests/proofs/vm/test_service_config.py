"""A mistake in the configuration: a person has to act, and systemd waits for that."""

from collections.abc import Iterator

import pytest

from proofs.vm.guest import unit
from proofs.vm.machine import Machine
from proofs.vm.tables import Tables

MISTAKEN = "devices: {cup: {driver: v4l2, options: {device: /dev/video0}, threshhold: {kind: automatic}}}\n"


@pytest.fixture
def mistaken(service: Machine) -> Iterator[Machine]:
    """The service with a mistake in its configuration; afterwards with the old one again."""
    before = service.call(unit.exchange_config, text=MISTAKEN)
    yield service
    service.call(unit.exchange_config, text=before)
    service.call(unit.systemctl, verb="restart", timeout_s=600)
    service.call(unit.until_ready, timeout_s=600)


def test_a_mistaken_configuration_ends_the_service_once_with_78(
    mistaken: Machine, service_tables: Tables
) -> None:
    mistaken.call(unit.systemctl, verb="restart", timeout_s=600)
    failed = mistaken.call(unit.until_failed, timeout_s=600)
    later = mistaken.call(unit.idle, seconds=60.0)
    assert failed["ExecMainStatus"] == "78"
    assert (later["ActiveState"], later["NRestarts"], later["MainPID"]) == ("failed", "0", "0")
    assert "threshhold" in mistaken.call(unit.journal)
    service_tables.add(
        "Failed starts",
        "Sixty seconds after the service exited.",
        what="a mistake in the configuration",
        exit_code=failed["ExecMainStatus"],
        restarts=later["NRestarts"],
        the_journal_names="the key, and what is wrong with it",
    )
