"""A client that a program has made of the API's description runs a capture from beginning to end."""

import fcntl
import hashlib
import json
import subprocess
import sys
import venv
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from grabberd.documents.enums import Role
from server.api.daemons import serving

ROOT = Path(__file__).parents[3]
CLIENT = Path(__file__).parent / "client"
REQUIREMENTS = CLIENT / "requirements.txt"
DESCRIPTION = ROOT / "docs" / "reference" / "openapi.json"
CONFIG = ROOT / "docs" / "reference" / "client.yaml"


def run(*command: object, **options: Any) -> str:
    done = subprocess.run(
        [str(word) for word in command], capture_output=True, text=True, timeout=100, check=False, **options
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def python() -> Path:
    """Of an environment with the generator and what its clients need; made once, kept in build/."""
    name = hashlib.sha256(REQUIREMENTS.read_bytes() + sys.version.encode()).hexdigest()[:12]
    folder = ROOT / "build" / f"client-{name}"
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not (folder / "ready").exists():
            venv.create(folder)
            pip = (sys.executable, "-m", "pip", "--python", folder / "bin" / "python")
            run(*pip, "install", "--quiet", "--no-deps", "--requirement", REQUIREMENTS)
            (folder / "ready").touch()
    return folder / "bin" / "python"


@pytest.fixture(scope="module")
def client(python: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder with the client; what the generator cannot make something of fails."""
    folder = tmp_path_factory.mktemp("client")
    generator = (python, "-m", "openapi_python_client", "generate", "--fail-on-warning", "--meta", "none")
    run(*generator, "--path", DESCRIPTION, "--config", CONFIG, "--output-path", folder / "grabberd_client")
    return folder


@pytest.fixture
def daemon(tmp_path: Path) -> Iterator[tuple[str, str]]:
    """Its address and the token of an operator."""
    with serving(tmp_path, pace="free") as running:
        yield running.url, running.service.access.add("script", Role.OPERATOR)


@pytest.mark.slow
def test_it_starts_waits_reads_and_deletes(python: Path, client: Path, daemon: tuple[str, str]) -> None:
    seen = json.loads(run(python, CLIENT / "capture.py", *daemon, env={"PYTHONPATH": str(client)}))
    assert seen["ids"][0] == seen["ids"][1]
    assert seen["labels"] == {"cow": "112"}
    assert seen["complete"]
    assert seen["received"] == 20
    assert seen["numbers"] == list(range(0, 20, 3))
    # A closed wall hides the targets at its folds: a field has two thirds of those of an open one.
    assert seen["lines"] - 1 >= 20 * seen["targets"] * 0.6 > 0
    assert bytes.fromhex(seen["picture"]) == b"\x89PNG"
    assert seen["deleted"] == 204
    assert "GET /api/v1/captures" in seen["hint"]


@pytest.mark.slow
def test_no_name_in_it_was_made_up_by_the_generator(client: Path) -> None:
    """Such as NewCaptureLinesType0, for a type that has no name in the description."""
    models = {file.stem for file in (client / "grabberd_client" / "models").glob("*.py")}
    assert {"new_capture", "capture_document", "ledger_document", "labels", "verdict"} <= models
    assert [name for name in models if "type_" in name or "response_" in name] == []
