"""Inside the machine: does what the host asks for, one call after the other.

A request is a line of JSON with the name of a function and its arguments; the answer is a line with its
result, or with the traceback of what it raised.
"""

import importlib
import json
import os
import time
import tomllib
import traceback
from pathlib import Path
from typing import Any

PORT = "/dev/virtio-ports/grabberd.vm"
METADATA = Path("/run/metadata")
"""What an installation would tell of entry points; first in PYTHONPATH."""


def main() -> None:
    """Until the machine is stopped."""
    _install_metadata(Path("/checkout/pyproject.toml"))
    while not os.path.exists(PORT):
        time.sleep(0.1)
    with open(PORT, "r+b", buffering=0) as port:
        _answer(port, {"ready": time.monotonic()})
        pending = b""
        while True:
            received = port.read(65536)
            if not received:
                time.sleep(0.02)
                continue
            *lines, pending = (pending + received).split(b"\n")
            for line in lines:
                _answer(port, _done(json.loads(line)))


def _install_metadata(project: Path) -> None:
    """Makes the checkout's drivers known by name, as installing it would."""
    document = tomllib.loads(project.read_text())["project"]
    folder = METADATA / "grabberd-0.dist-info"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "METADATA").write_text("Metadata-Version: 2.1\nName: grabberd\nVersion: 0\n")
    groups = document["entry-points"]
    (folder / "entry_points.txt").write_text(
        "".join(
            f"[{group}]\n" + "".join(f"{name} = {value}\n" for name, value in entries.items())
            for group, entries in groups.items()
        )
    )


def _done(request: dict[str, Any]) -> dict[str, Any]:
    started = time.monotonic()
    try:
        module, _, name = request["call"].partition(":")
        result = getattr(importlib.import_module(module), name)(**request["arguments"])
        return {"id": request["id"], "result": result, "guest_s": time.monotonic() - started}
    except BaseException:
        return {"id": request["id"], "error": traceback.format_exc(), "guest_s": time.monotonic() - started}


def _answer(port: Any, answer: dict[str, Any]) -> None:
    rest = memoryview(json.dumps(answer).encode() + b"\n")
    while rest:
        rest = rest[port.write(rest) or 0 :]


if __name__ == "__main__":
    main()
