"""Upgrades and rollbacks; where one of their steps fails, what was there before is there, and runs."""

import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from .rehearsed import PYTHON, Done, Rehearsed, copied, rehearsed, why_not
from .small_release import SYSTEMD

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform != "linux", reason="the installer is for Linux"),
    pytest.mark.skipif(why_not() is not None, reason=str(why_not())),
]


def steps_of(what: str) -> list[str]:
    """The installer's own list, so that no step can be forgotten here."""
    command = ["sh", SYSTEMD / "installer.sh", "steps", what]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()


AFTER_STOP = {name: steps_of(name)[steps_of(name).index("stop") :] for name in ("install", "rollback")}


@pytest.fixture(scope="module")
def venv(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder: Path = tmp_path_factory.mktemp("venv")
    subprocess.run([PYTHON, "-m", "venv", folder], check=True)
    return folder


@pytest.fixture
def empty(tmp_path: Path, venv: Path) -> Iterator[Rehearsed]:
    """Captures, and nothing installed."""
    with rehearsed(tmp_path, venv) as one:
        yield one


@pytest.fixture(scope="module")
def with_first(tmp_path_factory: pytest.TempPathFactory, venv: Path) -> Iterator[Rehearsed]:
    with rehearsed(tmp_path_factory.mktemp("first"), venv) as one:
        done = one.install("1")
        assert done.code == 0, done.said
        one.keep("of version 1")
        yield one


@pytest.fixture(scope="module")
def with_second(
    tmp_path_factory: pytest.TempPathFactory, with_first: Rehearsed
) -> Iterator[tuple[Rehearsed, Done]]:
    with copied(with_first, tmp_path_factory.mktemp("second")) as one:
        done = one.install("2", schema=2)
        one.keep("of version 2")
        yield one, done


@pytest.fixture
def first(tmp_path: Path, with_first: Rehearsed) -> Iterator[Rehearsed]:
    """Version 1 runs, and something has been kept."""
    with copied(with_first, tmp_path) as one:
        yield one


@pytest.fixture
def second(tmp_path: Path, with_second: tuple[Rehearsed, Done]) -> Iterator[Rehearsed]:
    """Upgraded to version 2, whose state version 1 cannot read, and something more has been kept."""
    made, done = with_second
    assert done.code == 0, done.said
    with copied(made, tmp_path) as one:
        yield one


def test_the_first_installation_runs(first: Rehearsed) -> None:
    assert (first.running, first.installed, first.kept) == ("1", "1", None), first.calls


def test_an_upgrade_takes_the_place_of_the_release_before_and_keeps_that(second: Rehearsed) -> None:
    assert (second.running, second.installed, second.kept) == ("2", "2", "1")
    unit = second.root / "usr/local/lib/systemd/system/grabberd.service"
    assert "# of 2" in unit.read_text()
    assert (second.schema, second.notes()) == (2, ["of version 1", "of version 2"])
    assert not [name for name in second.everything() if name.endswith((".new", ".old"))]


def test_only_the_release_before_is_kept(second: Rehearsed) -> None:
    assert second.install("3", schema=2).code == 0
    assert (second.running, second.kept) == ("3", "2")
    assert len(list((second.root / "opt/grabberd/releases").iterdir())) == 2


def test_a_rollback_brings_back_the_state_that_the_release_can_read_and_says_so(second: Rehearsed) -> None:
    done = second.rollback()
    assert done.code == 0, done.said
    assert (second.running, second.installed, second.kept) == ("1", "1", "2")
    assert (second.schema, second.notes()) == (1, ["of version 1"])
    assert "settings, tokens, pins and notes are those from before the upgrade" in done.said
    kept = Rehearsed(second.machine, second.root)
    kept.state = second.state.parent / "before-upgrade" / "state.sqlite"
    assert kept.notes() == ["of version 1", "of version 2"]


def test_a_rollback_keeps_a_state_that_the_release_can_read(first: Rehearsed) -> None:
    assert first.install("2").code == 0
    first.keep("of version 2")
    done = first.rollback()
    assert (done.code, first.running) == (0, "1"), done.said
    assert first.notes() == ["of version 1", "of version 2"]
    assert "from before the upgrade" not in done.said


def test_what_was_rolled_back_can_be_had_again(second: Rehearsed) -> None:
    assert second.rollback().code == 0
    assert second.rollback().code == 0
    assert (second.running, second.kept, second.schema) == ("2", "1", 2)


def test_without_a_release_before_there_is_no_rollback(first: Rehearsed) -> None:
    before = first.everything()
    done = first.rollback()
    assert done.code == 1
    assert "there is no release before" in done.said
    assert (first.everything(), first.running) == (before, "1")


@pytest.mark.parametrize("step", steps_of("install"))
def test_an_upgrade_that_fails_at_a_step_leaves_everything_as_it_was(first: Rehearsed, step: str) -> None:
    before, asked = first.everything(), len(first.calls)
    done = first.install("2", schema=2, FAIL_AT=step)
    assert done.code == 1
    assert f"failed at the step '{step}'" in done.said
    assert (first.everything(), first.running) == (before, "1")
    _assert_restarted_only_where_it_was_stopped(first.calls[asked:], done.said, step in AFTER_STOP["install"])


@pytest.mark.parametrize("step", steps_of("rollback"))
def test_a_rollback_that_fails_at_a_step_leaves_everything_as_it_was(second: Rehearsed, step: str) -> None:
    before, asked = second.everything(), len(second.calls)
    done = second.rollback(FAIL_AT=step)
    assert done.code == 1
    assert f"failed at the step '{step}'" in done.said
    assert (second.everything(), second.running) == (before, "2")
    _assert_restarted_only_where_it_was_stopped(
        second.calls[asked:], done.said, step in AFTER_STOP["rollback"]
    )


def _assert_restarted_only_where_it_was_stopped(calls: list[str], said: str, was_stopped: bool) -> None:
    changes = [call.split()[0] for call in calls if call.split()[0] in ("start", "stop")]
    assert changes[-1:] == (["start"] if was_stopped else [])
    assert ("runs again, with its state as it was" in said) == was_stopped
    assert ("was not disturbed" in said) == (not was_stopped)


@pytest.mark.parametrize("step", steps_of("install"))
def test_a_first_installation_that_fails_leaves_nothing(empty: Rehearsed, step: str) -> None:
    before = empty.everything()
    assert empty.install("1", FAIL_AT=step).code == 1
    left = empty.everything()
    assert left == before | {name: text for name, text in left.items() if name.endswith("state.sqlite")}


@pytest.mark.parametrize(
    ("what", "said"),
    [
        ("a module is missing", "No module named 'grabberd_replay'"),
        ("the configuration is refused", "2 refuses this configuration"),
        ("the state is too new", "this program knows up to 0"),
        ("it does not start", "2 does not start"),
        ("it is stuck", "2 does not answer within 1 s"),
    ],
)
def test_a_release_that_is_no_good_is_not_kept(first: Rehearsed, what: str, said: str) -> None:
    if what == "the configuration is refused":
        first.config.write_text("not for 2")
    (first.machine / "does-not-start-2").touch() if what == "it does not start" else None
    (first.machine / "is-stuck-2").touch() if what == "it is stuck" else None
    before = first.everything()
    done = first.install(
        "2",
        schema=0 if what == "the state is too new" else 2,
        without="grabberd_replay" if what == "a module is missing" else None,
        HEALTH_S="1" if what == "it is stuck" else "60",
    )
    assert done.code == 1
    assert said in done.said
    assert (first.everything(), first.running) == (before, "1")


def test_a_configuration_that_the_release_before_refuses_as_well_holds_up_no_upgrade(
    first: Rehearsed,
) -> None:
    first.config.write_text("not for 1, not for 2")
    done = first.install("2")
    assert (done.code, first.running) == (0, "2"), done.said
    assert "refused by 2, but also by 1" in done.said


def test_a_release_before_that_does_not_come_up_again_is_told(first: Rehearsed) -> None:
    for version in ("1", "2"):
        (first.machine / f"does-not-start-{version}").touch()
    done = first.install("2")
    assert done.code == 1
    assert "1 is the installed version again" in done.said
    assert "does not answer: journalctl -u grabberd says why" in done.said


def test_a_service_that_is_masked_is_upgraded_and_not_started(first: Rehearsed) -> None:
    (first.machine / "enabled").write_text("masked\n")
    asked = len(first.calls)
    done = first.install("2")
    assert (done.code, first.installed) == (0, "2"), done.said
    assert not [call for call in first.calls[asked:] if call.startswith(("start", "enable"))]


def test_a_journal_that_a_crash_left_beside_the_state_is_put_back_with_it(first: Rehearsed) -> None:
    journal = first.state.with_name("state.sqlite-journal")
    journal.write_bytes(b"no header of a journal, so SQLite leaves it alone")
    before = first.everything()
    assert first.install("2", schema=2, FAIL_AT="backup").code == 1
    assert first.everything() == before


def test_an_installer_that_is_told_to_end_undoes_what_it_did(first: Rehearsed) -> None:
    (first.machine / "is-stuck-2").touch()
    before = first.everything()
    first.install("2", schema=2, FAIL_AT="space")
    installer = first.machine / "bundle-2" / "installer.sh"
    with subprocess.Popen(
        ["sh", installer, "install"], env=first.environment(), stderr=subprocess.PIPE, text=True
    ) as process:
        until = time.monotonic() + 60
        while first.running != "2" and time.monotonic() < until:
            time.sleep(0.02)
        process.send_signal(signal.SIGTERM)
        (first.machine / "is-stuck-2").unlink()
        _, said = process.communicate(timeout=100)
    assert (first.everything(), first.running) == (before, "1"), said


def test_two_installers_do_not_run_side_by_side(first: Rehearsed) -> None:
    with subprocess.Popen(["flock", first.root / "opt/grabberd/lock", "sleep", "60"]) as held:
        until = time.monotonic() + 30
        while not subprocess.run(
            ["flock", "-n", first.root / "opt/grabberd/lock", "true"], check=False
        ).returncode:
            assert time.monotonic() < until
        done = first.install("2")
        held.terminate()
    assert done.code == 1
    assert "another installation is running" in done.said


@pytest.fixture
def small_disk(tmp_path: Path, venv: Path) -> Iterator[Rehearsed]:
    """Version 1 runs; the root is a disk of its own with room for two releases and a half."""
    root = tmp_path / "disk"
    root.mkdir()
    size_kb = 3 * sum(path.stat().st_size for path in venv.rglob("*") if path.is_file()) // 1024 + 8000
    mount = ["mount", "-t", "tmpfs", "-o", f"size={size_kb}k", "none", root]
    if subprocess.run(mount, capture_output=True, check=False).returncode:
        pytest.skip("this computer lets nobody mount a disk: run it as root")
    try:
        with rehearsed(tmp_path, venv, root) as one:
            done = one.install("1")
            assert done.code == 0, done.said
            one.keep("of version 1")
            yield one
    finally:
        subprocess.run(["umount", "--lazy", root], check=True)


@pytest.mark.parametrize("moment", ["venv", "check-config", "stop"])
def test_a_disk_that_fills_up_during_an_upgrade_leaves_the_release_before_running(
    small_disk: Rehearsed, moment: str
) -> None:
    before = small_disk.everything()
    done = small_disk.install("2", schema=2, FILL_AT=moment)
    assert done.code == 1
    assert "No space left on device" in done.said
    assert (small_disk.everything(), small_disk.running) == (before, "1"), done.said


def test_a_disk_without_room_for_a_release_is_told_before_anything_is_done(small_disk: Rehearsed) -> None:
    subprocess.run([small_disk.machine / "programs/fill"], env=small_disk.environment(), check=True)
    before = small_disk.everything()
    done = small_disk.install("2")
    assert done.code == 1
    assert "MB free, a release needs" in done.said
    assert (small_disk.everything(), small_disk.running) == (before, "1")


def test_a_disk_that_is_full_once_the_new_release_runs_is_no_reason_to_go_back(small_disk: Rehearsed) -> None:
    done = small_disk.install("2", schema=2, FILL_AT="start")
    assert (done.code, small_disk.running, small_disk.kept) == (0, "2", "1"), done.said
    shutil.rmtree(small_disk.root / "filler", ignore_errors=True)
