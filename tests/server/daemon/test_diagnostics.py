"""The diagnostics: what is in them, and what never is."""

import io
import json
import logging
import zipfile
from pathlib import Path

from running import running, sealed

from grabberd.documents.enums import Role
from grabberd.instrument.capture.capture_request import CaptureRequest
from grabberd.server.daemon.diagnostics import bundle, daemon_parts, last_lines, machine_parts


def read(content: bytes) -> dict[str, str]:
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        return {name: archive.read(name).decode() for name in archive.namelist()}


def test_a_daemon_tells_everything_but_secrets_and_peoples_words(tmp_path: Path) -> None:
    with running(tmp_path) as service:
        token = service.access.add("me", Role.ADMIN)
        service.capture_control.start(
            None, CaptureRequest(fields=5, note="her own words", labels={"cow": "Berta"})
        )
        sealed(service)
        last_lines.handle(logging.LogRecord("x", logging.INFO, "", 0, "asked with %s", (token,), None))
        parts = read(bundle(daemon_parts(service)))
        with_words = read(bundle(daemon_parts(service, words=True), words=True))
    whole = "".join(parts.values())
    assert token not in whole
    assert "her own words" not in whole
    assert "Berta" not in whole
    assert "Berta" in with_words["captures.json"]
    assert all(name in parts["README.txt"] for name in parts if name != "README.txt")
    (capture,) = json.loads(parts["captures.json"])
    assert capture["ledger"]["counts"]["received"] == 5
    assert json.loads(parts["state.json"])["devices"]["simulated"]["driver"] == "fake"
    assert json.loads(parts["configuration.json"])["devices"]
    assert "asked with" in parts["log.jsonl"]


def test_a_computer_without_a_daemon_tells_its_versions_and_grabbers() -> None:
    parts = read(bundle(machine_parts()))
    versions = json.loads(parts["versions.json"])
    assert {"numpy", "fastapi"} <= {name.lower() for name in versions["packages"]}
    assert "fake" in json.loads(parts["grabbers.json"])["drivers"]
    assert "No daemon" in parts["README.txt"]


def test_a_part_that_cannot_be_made_says_why_and_costs_no_other() -> None:
    def broken() -> str:
        raise OSError("the disk is gone")

    parts = read(bundle({"captures.json": broken, "log.jsonl": lambda: "fine\n"}))
    assert "the disk is gone" in parts["captures.json"]
    assert parts["log.jsonl"] == "fine\n"
