"""The instrument where the liner science is not installed: nothing of that is missing, or there and empty."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from tests.house.locks.state import restore, secrets

from grabberd.config import shipped_configs

ROOT = Path(__file__).parents[1]
WITHOUT = """
import importlib.metadata, sys

class Absent:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] == "grabberd_liner":
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)

sys.meta_path.insert(0, Absent())
installed = importlib.metadata.entry_points
importlib.metadata.entry_points = lambda **of: [
    one for one in installed(**of) if not one.value.startswith("grabberd_liner")
]
"""
COMMAND = "from grabberd.cli import main; main()"
DAEMON = """
import json, sys
from pathlib import Path
from fastapi.testclient import TestClient
from grabberd.config import default_config_file, load_config
from grabberd.instrument.setup import set_up
from grabberd.server.api import create_app
from grabberd.server.daemon.service import Service

file = default_config_file()
service = Service(set_up(load_config(file), file), Path(sys.argv[1]))
key = {"Authorization": f"Bearer {sys.argv[2]}"}
service.open()
service.archive.open()
service.open_stores()
app = create_app(service)
client = TestClient(app, "http://localhost")
paths = "/api/v1/jobs", "/api/v1/captures", "/api/v1/captures/object", "/api/v1/state"
answers = {path: client.get(path, headers=key).json() for path in paths}
page = client.get("/", headers=key).status_code
head = client.get("/api/v1/captures.csv", headers=key).text.splitlines()[0]
print(json.dumps({"answers": answers, "page": page, "head": head, "paths": sorted(app.openapi()["paths"])}))
service.processes.end()
service.archive.close()
service.state_keeper.close()
"""


def run(program: str, *words: object) -> subprocess.CompletedProcess[str]:
    """Runs a program that finds no extension."""
    command = [sys.executable, "-c", WITHOUT + program, *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=240, cwd=ROOT)


@pytest.fixture(scope="module")
def daemon(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """What a daemon answers on a state directory with analyses, profiles and waiting jobs of every kind."""
    folder = tmp_path_factory.mktemp("state")
    restore(folder)
    done = run(DAEMON, folder, secrets()["admin"])
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_the_help_has_the_instruments_commands_alone() -> None:
    words = run(COMMAND, "--help").stdout
    assert all(f" {name} " in words for name in ("capture", "calibrate", "measure", "accuracy", "export"))
    assert not any(f" {name} " in words for name in ("analyse", "study", "test", "profile", "render"))


def test_a_capture_is_made_measured_and_exported(tmp_path: Path) -> None:
    file, folder = tmp_path / "made.grab", tmp_path / "points"
    config = shipped_configs() / "fake.yaml"
    made = run(COMMAND, "capture", "--config", config, "--option", "pace=free", "--fields", 16, "--out", file)
    assert made.returncode == 0, made.stderr
    exported = run(COMMAND, "export", file, "--format", "csv", "--out", folder)
    assert exported.returncode == 0, exported.stderr
    assert any(folder.iterdir())


def test_the_library_opens_a_capture_and_says_what_an_analysis_takes() -> None:
    opened = "import grabberd; capture = grabberd.open(grabberd.example('liner.grab'))"
    done = run(f"{opened}; print(len(capture.points())); capture.analyse")
    assert int(done.stdout) > 0
    assert "AttributeError" in done.stderr


def test_jobs_of_the_liner_science_are_refused_with_the_reason_and_stay_listed(daemon: Any) -> None:
    jobs = daemon["answers"]["/api/v1/jobs"]["jobs"]
    refused = [one for one in jobs if one["problem"] and "knows no job" in one["problem"]["message"]]
    assert {"analyse", "test"} <= {one["kind"] for one in refused}
    assert all(one["state"] == "failed" for one in refused)
    assert any(one["state"] == "queued" for one in jobs if one["kind"] not in ("analyse", "test"))


def test_captures_with_analyses_are_shown_without_them(daemon: Any) -> None:
    assert daemon["page"] == 200
    assert "analysis" not in daemon["answers"]["/api/v1/captures/object"]
    assert not {"latest_analysis", "latest_test"} & set(
        daemon["answers"]["/api/v1/state"]["devices"]["simulated"]
    )
    assert "analysis" not in daemon["head"]


def test_the_api_has_no_route_of_the_liner_science(daemon: Any) -> None:
    assert not [one for one in daemon["paths"] if "analys" in one or "profiles" in one or "study" in one]
