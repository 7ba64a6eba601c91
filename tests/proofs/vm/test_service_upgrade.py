"""The service is upgraded, at first in vain, and taken back to the release before."""

import pytest

from proofs.vm.guest import client, unit
from proofs.vm.machine import Machine
from proofs.vm.tables import Tables

NOTE = "The same bundle once more; seconds until the installer had ended."
TITLE = "Upgrades"
LONG_S = 1500
"""Of the host's time: an installer that starts Python a dozen times, and the daemon twice."""


@pytest.mark.timeout(LONG_S)
@pytest.mark.parametrize("step", ["imports", "health"])
def test_an_upgrade_that_fails_leaves_the_release_before_running(
    service: Machine, service_tables: Tables, step: str, request: pytest.FixtureRequest
) -> None:
    if not request.config.getoption("--write-tables"):
        pytest.skip("takes minutes, and tests/systemd fails every step in a scratch root: WRITE=1 runs it")
    before, pid = service.call(unit.releases), service.call(unit.main_pid)
    capture_id = service.call(client.capture, fields=25)["id"]
    digests = service.call(unit.digests, folder="captures")
    done = service.call(unit.upgrade, fail_at=step, timeout_s=LONG_S - 300)
    service.call(unit.until_ready, timeout_s=600)
    service_tables.add(
        TITLE, NOTE, what=f"fails at the step {step}", installer=_s(done), releases=_kept(done)
    )
    assert done["exit"] == 1, done["said"]
    assert f"failed at the step '{step}'" in done["said"]
    assert {name: done[name] for name in before} == before
    assert (service.call(unit.main_pid) == pid) == (step == "imports"), done["said"]
    assert capture_id in service.call(client.listed)
    after = service.call(unit.digests, folder="captures")
    assert {name: after.get(name) for name in digests if name.endswith(".grab")} == {
        name: digest for name, digest in digests.items() if name.endswith(".grab")
    }


@pytest.mark.timeout(2 * LONG_S)
def test_an_upgrade_keeps_the_release_before_and_a_rollback_brings_it_back(
    service: Machine, service_tables: Tables
) -> None:
    first = service.call(unit.releases)["current"]
    upgraded = service.call(unit.upgrade, timeout_s=LONG_S)
    assert upgraded["exit"] == 0, upgraded["said"]
    service.call(unit.until_ready, timeout_s=600)
    service_tables.add(TITLE, NOTE, what="succeeds", installer=_s(upgraded), releases=_kept(upgraded))
    assert upgraded["previous"] == first
    assert upgraded["current"] != first
    assert len(upgraded["all"]) == 2
    assert service.call(client.capture, fields=25)["verdict"] == "complete"
    back = service.call(unit.roll_back, timeout_s=LONG_S)
    assert back["exit"] == 0, back["said"]
    service.call(unit.until_ready, timeout_s=600)
    service_tables.add(TITLE, NOTE, what="is rolled back", installer=_s(back), releases=_kept(back))
    assert (back["current"], back["previous"]) == (first, upgraded["current"])
    assert service.call(client.capture, fields=25)["verdict"] == "complete"


def _s(done: dict[str, object]) -> str:
    return f"{done['seconds']:.0f} s"


def _kept(done: dict[str, object]) -> str:
    return str(len(list(done["all"])))  # type: ignore[call-overload]
