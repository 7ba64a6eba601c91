"""The Debian package: the same bytes every time; installed, upgraded, taken back, removed, purged."""

import hashlib
import json
import re
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from .packaged import RELEASE, Packaged, why_not, write_bundle, write_package
from .rehearsed import rehearsed
from .rehearsed import why_not as no_rehearsal

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(why_not() is not None, reason=str(why_not())),
    pytest.mark.skipif(no_rehearsal() is not None, reason=str(no_rehearsal())),
]
KEPT = {"var/lib/grabberd/captures/liner.grab", "var/lib/grabberd/state.sqlite"}


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_bundle(tmp_path_factory.mktemp("bundle"), "1")


@pytest.fixture(scope="module")
def first(bundle: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_package(bundle, tmp_path_factory.mktemp("first"))


@pytest.fixture(scope="module")
def second(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Its state is one that the first cannot read."""
    folder = tmp_path_factory.mktemp("second")
    return write_package(write_bundle(folder, "2", schema=2), folder / "made")


@pytest.fixture
def machine(tmp_path: Path) -> Iterator[Packaged]:
    with rehearsed(tmp_path, tmp_path) as one:
        machine = Packaged(one.machine, one.root)
        machine.state, machine.config = one.state, one.config
        yield machine


@pytest.fixture
def with_first(machine: Packaged, first: Path) -> Packaged:
    """Version 1 runs, and something has been kept."""
    done = machine.dpkg("--install", first)
    assert done.code == 0, done.said
    machine.keep("of version 1")
    return machine


def test_two_builds_are_the_same_bytes(bundle: Path, first: Path, tmp_path: Path) -> None:
    again = write_package(bundle, tmp_path)
    assert hashlib.sha256(again.read_bytes()).digest() == hashlib.sha256(first.read_bytes()).digest()
    for name in (first.with_suffix(".cdx.json").name, "SHA256SUMS"):
        assert (again.parent / name).read_bytes() == (first.parent / name).read_bytes()


def test_what_is_in_it_lies_beside_it_with_digests(first: Path) -> None:
    said = json.loads(first.with_suffix(".cdx.json").read_text())
    assert (said["bomFormat"], said["specVersion"]) == ("CycloneDX", "1.5")
    assert said["metadata"]["component"]["purl"] == "pkg:pypi/grabberd@1"
    check = ["sha256sum", "--check", "--quiet", "SHA256SUMS"]
    assert subprocess.run(check, cwd=first.parent, check=False).returncode == 0


def test_everything_is_roots_and_nobody_elses_to_write(first: Path) -> None:
    listed = subprocess.run(["dpkg-deb", "--contents", first], capture_output=True, text=True, check=True)
    for line in listed.stdout.splitlines():
        rights, owner = line.split()[:2]
        assert owner == "root/root"
        assert rights.startswith("l") or rights[5] == rights[8] == "-", line


def test_nothing_in_it_names_the_folder_it_was_made_in(first: Path, tmp_path: Path) -> None:
    subprocess.run(["dpkg-deb", "--extract", first, tmp_path], check=True)
    grep = ["grep", "-rlE", "/tmp/|/opt/grabberd/current/(bin|share)", tmp_path / "usr"]
    found = subprocess.run(grep, capture_output=True, text=True, check=False)
    assert [name for name in found.stdout.splitlines() if not name.endswith(".sh")] == []


def test_it_is_installed_and_runs(with_first: Packaged) -> None:
    assert (with_first.status, with_first.running) == ("install ok installed", "1")
    unit = (with_first.root / "usr/lib/systemd/system/grabberd.service").read_text()
    assert f"ExecStart=/{RELEASE}/bin/grabberd serve" in unit
    assert "enable --quiet grabberd.socket grabberd.service" in with_first.calls


def test_who_installs_it_is_told_where_everything_is(machine: Packaged, first: Path, second: Path) -> None:
    said = machine.dpkg("--install", first).said
    assert "configuration: /etc/grabberd/grabberd.yaml   captures: /var/lib/grabberd/captures" in said
    assert re.search(r"page: http://127\.0\.0\.1:\d+$", said, re.MULTILINE), said
    assert "page: " not in machine.dpkg("--install", second).said


def test_an_upgrade_keeps_the_configuration_and_a_copy_of_the_state(
    with_first: Packaged, second: Path
) -> None:
    with_first.config.write_text("# ours\n")
    asked = len(with_first.calls)
    done = with_first.dpkg("--install", second)
    assert (done.code, with_first.running) == (0, "2"), done.said
    assert with_first.config.read_text() == "# ours\n"
    verbs = [call.split()[0] for call in with_first.calls[asked:]]
    assert verbs.index("stop") < verbs.index("start")
    assert (with_first.schema, with_first.notes()) == (2, ["of version 1"])
    saved = Packaged(with_first.machine, with_first.root)
    saved.state = with_first.state.parent / "before-upgrade/state.sqlite"
    assert (saved.schema, saved.notes()) == (1, ["of version 1"])


def test_the_version_before_comes_back_with_the_state_that_it_can_read(
    with_first: Packaged, first: Path, second: Path
) -> None:
    assert with_first.dpkg("--install", second).code == 0
    with_first.keep("of version 2")
    done = with_first.dpkg("--install", first)
    assert (done.code, with_first.running) == (0, "1"), done.said
    assert "settings, tokens, pins and notes are those from before the upgrade" in done.said
    assert (with_first.schema, with_first.notes()) == (1, ["of version 1"])


def test_an_upgrade_that_does_not_answer_is_told_by_dpkg_and_can_be_taken_back(
    with_first: Packaged, first: Path, second: Path
) -> None:
    (with_first.machine / "is-stuck-2").touch()
    done = with_first.dpkg("--install", second, HEALTH_S="1")
    assert done.code != 0
    assert "2 does not answer within 1 s" in done.said
    assert with_first.status == "install ok half-configured"
    back = with_first.dpkg("--install", first)
    assert (back.code, with_first.status, with_first.running) == (0, "install ok installed", "1"), back.said
    assert with_first.notes() == ["of version 1"]


def test_removed_it_leaves_captures_state_and_configuration(with_first: Packaged) -> None:
    done = with_first.dpkg("--remove", "grabberd")
    assert done.code == 0, done.said
    assert with_first.running is None
    assert "disable --quiet grabberd.socket grabberd.service" in with_first.calls
    assert with_first.left == KEPT | {"etc/grabberd/grabberd.yaml"}
    assert with_first.status == "deinstall ok config-files"


def test_purged_it_leaves_captures_and_state(with_first: Packaged) -> None:
    done = with_first.dpkg("--purge", "grabberd")
    assert done.code == 0, done.said
    assert with_first.left == KEPT
    assert not with_first.config.parent.exists()


def test_beside_an_installation_by_the_installer_it_is_refused(machine: Packaged, first: Path) -> None:
    (machine.root / "opt/grabberd/current").mkdir(parents=True)
    done = machine.dpkg("--install", first)
    assert done.code != 0
    assert "installer.sh uninstall" in done.said
    assert machine.status in ("unknown", "install ok not-installed")
