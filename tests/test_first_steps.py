"""The first steps are typed as they stand, line by line, in an empty folder."""

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from running import PATIENCE_S

import grabberd
from server.api.daemons import Daemon, serving

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs" / "howto" / "first-steps.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def daemon(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    with serving(tmp_path_factory.mktemp("daemon"), pace="real") as running:
        yield running


def lines_of(section: str) -> list[str]:
    """The commands below a heading."""
    part = PAGE.split(f"## {section}\n")[1].split("\n## ")[0]
    return re.findall(r"^    (\S.*)$", part, re.MULTILINE)


def type_in(folder: Path, line: str) -> str:
    """What a line prints that a person types into a shell there."""
    path = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
    environment = {**os.environ, "PATH": path, "STATE_DIRECTORY": str(folder / "state"), "GRABBERD_URL": ""}
    shell = ["bash", "-c", f"set -e; {line}"]
    done = subprocess.run(shell, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"{line}\n{done.stdout}{done.stderr}"
    return done.stdout


@pytest.mark.slow
def test_a_capture_over_http(daemon: Daemon, tmp_path: Path) -> None:
    host = daemon.url.removeprefix("http://")
    start, *others = [line.replace("localhost:8050", host) for line in lines_of("A capture over HTTP")]
    assert len(others) == 4
    said = re.search(r'"id": ?"([^"]+)"', type_in(tmp_path, start))
    assert said is not None
    grabberd.connect(daemon.url).capture(said[1]).wait(PATIENCE_S)
    for line in others:
        type_in(tmp_path, line.replace("ID", said[1]))
    assert len(grabberd.open(tmp_path / f"{said[1]}.grab").fields) == 64
    assert (tmp_path / "points.csv").stat().st_size > 100_000
    assert (tmp_path / "0.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.slow
@pytest.mark.parametrize("section", ["The same without a daemon", "From calibration to accuracy"])
def test_commands(section: str, tmp_path: Path) -> None:
    (tmp_path / "configs").symlink_to(ROOT / "configs")
    lines = lines_of(section)
    assert len(lines) >= 3
    said = [type_in(tmp_path, line) for line in lines]
    assert "RMSE" in said[-1]
