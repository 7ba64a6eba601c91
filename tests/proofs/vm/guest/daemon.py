"""The daemon as a user starts it, and one who asks it over HTTP."""

import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
import urllib.request
from pathlib import Path
from typing import Any

import yaml

from proofs.vm.guest import vivid
from proofs.vm.guest.shell import wait_for

ADDRESS = "http://127.0.0.1:8050"
PATIENCE_S = 240.0
CONFIGS = "/run/copy/configs"


def captured_liner(film: str, fields: int, target: str) -> dict[str, Any]:
    """Plays a film into the device, captures it through a daemon of its own and fetches the capture's file.

    Returns:
        the capture's document, the device's, and how long the start and the capture took.
    """
    shutil.copy(film, "/dev/shm/film")
    vivid.play("/dev/shm/film")
    folder = Path(tempfile.mkdtemp(prefix="grabberd-", dir="/dev/shm"))
    config = _configuration(folder)
    started = time.monotonic()
    log = (folder / "log").open("w")
    command = [
        sys.executable,
        "-c",
        "from grabberd.cli import main; main()",
        "serve",
        "--config",
        str(config),
    ]
    environment = {**os.environ, "STATE_DIRECTORY": str(folder)}
    daemon = subprocess.Popen(command, env=environment, stdout=log, stderr=log)
    try:
        wait_for(lambda: daemon.poll() is not None or _is_ready(), PATIENCE_S, 0.2)
        assert daemon.poll() is None, (folder / "log").read_text()[-3000:]
        ready_s = time.monotonic() - started
        document = _capture(fields)
        Path(target).write_bytes(_get(f"/api/v1/captures/{document['id']}/file"))
        device = json.loads(_get("/api/v1/state"))["devices"]["liner"]
    finally:
        daemon.terminate()
        daemon.wait(60)
        vivid.stop_playing()
    return {
        "capture": document,
        "device": device,
        "ready_s": ready_s,
        "log": (folder / "log").read_text()[-3000:],
    }


def _configuration(folder: Path) -> Path:
    """The simulated grabber's configuration with the kernel's device in its place."""
    document = yaml.safe_load(Path(CONFIGS, "fake.yaml").read_text())
    del document["loggers"]
    liner = document["devices"].pop("simulated")
    liner["driver"] = "v4l2"
    liner["options"] = {"device": vivid.CAPTURE, "input": 0, "field_order": "interlaced", "format": "GREY"}
    liner |= {name: str(Path(CONFIGS, liner[name])) for name in ("calibration", "object")}
    document["devices"]["liner"] = liner
    file = folder / "liner.yaml"
    file.write_text(yaml.safe_dump(document))
    return file


def _capture(fields: int) -> dict[str, Any]:
    begun = json.loads(_get("/api/v1/captures", {"fields": fields}))
    document: dict[str, Any] = begun

    def sealed() -> bool:
        document.update(json.loads(_get(f"/api/v1/captures/{begun['id']}")))
        return document["state"] not in ("recording", "sealing")

    wait_for(sealed, PATIENCE_S, 0.5)
    return document


def _is_ready() -> bool:
    try:
        devices = json.loads(_get("/api/v1/state"))["devices"]
    except OSError:
        return False
    return bool(devices["liner"]["state"] == "ready")


def _get(path: str, body: dict[str, Any] | None = None) -> bytes:
    data = None if body is None else json.dumps(body).encode()
    request = urllib.request.Request(ADDRESS + path, data, {"Content-Type": "application/json"})
    with urllib.request.urlopen(request, timeout=120) as answer:
        content: bytes = answer.read()
    return content
