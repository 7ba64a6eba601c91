"""A state directory with something of everything in it, and a queue in which every kind of job waits."""

import json
import shutil
import sqlite3
import tempfile
from collections.abc import Mapping
from contextlib import closing
from datetime import timedelta
from pathlib import Path
from typing import Any

import yaml
from fastapi.testclient import TestClient

import grabberd

from .doors import KINDS, Outbox, Role, Service, create_app, liner_of, opened, service_in
from .exits import FORMAT_1, grabberd_root, run
from .kept import KEPT, plain

FOLDER = KEPT / "state"
DATABASES = {"state": Path("state.sqlite"), "queue": Path("jobs", "queue.sqlite")}
CAPTURES = ("liner.grab", "object.grab")
MASKED = ("captures_folder", "origin")
"""Settings that are true of one folder of one computer alone."""
SMALL = ("calibrations/*/*.json", "analyses/*/*/record.json", "tests/*/test.json")
PROFILES = (
    "liner-example-reference",
    "pulsator-example-simulated",
    "cup-example-simulated",
    "cow-example-112",
)
KEY = {"Idempotency-Key": "lock-1"}
ONCE = {"profile": {"kind": "cow", "name": "once", "lactation": 1}}
"""A request that was sent once; repeated, it has the same answer."""
SUMMARY = {"capture_id": "liner", "note": "a receiver waits for it"}
TEST = "test-kept"
PROBLEM = {"message": "the analysis was cancelled", "hint": "analyse the capture again"}
WAIT_S = 300.0
API = "/api/v1"


def make() -> None:
    """Makes the directory by a running service, and keeps its databases as SQL and its small files."""
    shutil.rmtree(FOLDER, ignore_errors=True)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "captures").mkdir()
        for one in CAPTURES:
            shutil.copy(grabberd.example(one), folder / "captures")
        made_utc = _filled(folder)
        _queued(folder, made_utc)
        _keep(folder)


def restore(folder: Path) -> None:
    """Writes the kept state directory into an empty folder."""
    for name, path in DATABASES.items():
        (folder / path).parent.mkdir(exist_ok=True)
        with closing(sqlite3.connect(folder / path)) as connection:
            connection.executescript((FOLDER / f"{name}.sql").read_text(encoding="utf-8"))
    for file in FOLDER.rglob("*.json"):
        place = folder / file.relative_to(FOLDER)
        place.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(file, place)
    (folder / "captures").mkdir()
    for one in CAPTURES:
        shutil.copy(grabberd.example(one), folder / "captures")


def secrets() -> dict[str, str]:
    """Tokens of the kept state by name, the session's cookie, and the time at which it was made."""
    found: dict[str, str] = json.loads((FOLDER / "secrets.json").read_text(encoding="utf-8"))
    return found


def _filled(folder: Path) -> str:
    service = service_in(folder)
    with TestClient(create_app(service), "http://localhost") as client:
        tokens = {role.value: service.access.add(f"{role.value}-one", role) for role in Role}
        tokens["brief"] = service.access.add("brief", Role.VIEWER, timedelta(hours=1))
        admin = {"Authorization": f"Bearer {tokens['admin']}"}
        session = client.post(f"{API}/session", headers={"Authorization": f"Bearer {tokens['operator']}"})
        tokens["cookie"] = session.headers["set-cookie"].partition(";")[0]
        client.cookies.clear()
        _asked(client, admin)
        _jobs_ended(client, admin, service)
        outbox = Outbox(folder / DATABASES["state"])
        outbox.enter("liner", SUMMARY)
        outbox.enter("object", SUMMARY)
        outbox.acknowledge("object")
        tokens["made_utc"] = service.clock.utc_now().isoformat()
    _test_made(folder)
    (folder / "secrets.json").write_text(json.dumps(tokens, indent=1) + "\n")
    return tokens["made_utc"]


def _asked(client: TestClient, admin: Mapping[str, str]) -> None:
    """What an operator has chosen."""
    labels = {"cow": "example-112", "liner": "example-reference", "teat": "front left"}
    kept = {"pinned": True, "note": "kept for ever", "labels": labels, "marks": {"25": "open", "3": "first"}}
    document = json.loads((grabberd_root() / "configs" / "fake.calibration.json").read_text())
    other, third = ({**document, "id": f"stored-{name}"} for name in ("active", "rejected"))
    calls = [
        ("PATCH", "captures/liner", kept),
        ("PATCH", "captures/object", {"note": ""}),
        ("PUT", "settings", {"threshold": {"kind": "fixed", "value": 96}}),
        *(("POST", "profiles", {"profile": _profile(name)}) for name in PROFILES),
        (
            "PUT",
            "profiles/cow/example-112",
            {"profile": {**_profile(PROFILES[3]), "lactation": 3}, "after": 1},
        ),
        ("DELETE", "profiles/cup/example-simulated", None),
        ("POST", "calibrations", {"document": other, "note": "after the lens was cleaned"}),
        ("POST", "calibrations", {"document": third}),
        ("PUT", "calibrations/active", {"id": "stored-active"}),
        ("PUT", "calibrations/stored-rejected/rejection", {"note": "the frame was touched"}),
    ]
    for method, path, body in calls:
        done = client.request(method, f"{API}/{path}", json=body, headers=dict(admin))
        assert done.is_success, f"{method} {path}: {done.text}"
    assert client.post(f"{API}/profiles", json=ONCE, headers={**admin, **KEY}).status_code == 201


def _jobs_ended(client: TestClient, admin: Mapping[str, str], service: Service) -> None:
    """A measurement that fails, one that is done, an analysis, and an identification."""
    for path in ("object/measure", "liner/measure", "object/analysis", "liner/identification"):
        done = client.post(f"{API}/captures/{path}", json={}, headers=dict(admin))
        assert done.is_success, done.text
        service.jobs.wait(done.json()["id"], WAIT_S)


def _test_made(folder: Path) -> None:
    out = folder / "tested"
    run(["test", "reference", str(FORMAT_1 / "simulated.grab"), "--out", str(out)], folder)
    (folder / "tests" / TEST).mkdir(parents=True, exist_ok=True)
    shutil.move(out / "test.json", folder / "tests" / TEST)


def _profile(name: str) -> Any:
    return yaml.safe_load((grabberd_root() / "configs" / "profiles" / f"{name}.yaml").read_text("utf-8"))


def _queued(folder: Path, made_utc: str) -> None:
    """Jobs of every kind wait; one was running when the daemon ended, one is of no kind that is known."""
    with opened(folder, made_utc) as service:
        documents = service.instruments["simulated"].setup.made_with
        frame = yaml.safe_load(grabberd.example("calibration-frame.yaml").read_text("utf-8"))
        found = liner_of(service).profiles.of_labels({"liner": "example-reference", "cow": "example-112"})
        for parameters in _waiting(plain(documents), frame, found):
            kind = parameters.pop("kind")
            service.jobs.submit(KINDS[kind].model_validate(parameters), automatic=kind == "test")
    with closing(sqlite3.connect(folder / DATABASES["queue"])) as connection, connection:
        first = connection.execute("SELECT min(number) FROM jobs WHERE state = 'queued'").fetchone()[0]
        connection.execute("UPDATE jobs SET state = 'running', attempts = 1 WHERE number = ?", (first,))
        copied = (
            "SELECT max(number) + 1, 'foretell', subject, 0, 'queued', created_utc, NULL, 0, '{}', NULL, NULL"
        )
        connection.execute(f"INSERT INTO jobs {copied} FROM jobs")
        connection.execute("INSERT INTO unanalysed VALUES ('liner', 'cancelled', ?)", (json.dumps(PROBLEM),))


def _waiting(made_with: dict[str, Any], frame: Any, found: Any) -> list[dict[str, Any]]:
    missing = "20260301T093000125Z-barn"
    inputs = {"reference": "nominal", "heights_mm": [-30, 0, float("nan")]}
    options = {"weights": "equal", "alpha": 0.01}
    return [
        {"kind": "measure", "subject": "object", "made_with": made_with},
        {"kind": "measure", "subject": missing, "made_with": {**made_with, "object": None}},
        {
            "kind": "analyse",
            "subject": "liner",
            "inputs": inputs,
            "bursts": ["object"],
            "run_number": 1,
            "vacuum_log": "time_s,liner_vacuum_kpa\n0,42\n",
            "profiles": found,
            "source": "a file",
            "sources": {"vacuum.log": "log.csv"},
            "pulsating": True,
        },
        {"kind": "analyse", "subject": missing},
        {
            "kind": "calibrate",
            "subject": missing,
            "further": ["second", "third"],
            "note": "two poses",
            "calibration_frame": frame,
            "options": options,
            "device": "simulated",
            "previous": made_with["calibration"],
        },
        {"kind": "identify", "subject": missing, "calibration_frame": frame},
        {
            "kind": "check",
            "subject": missing,
            "seconds": 10.0,
            "calibration_frame": frame,
            "calibration": made_with["calibration"],
            "in_place": True,
        },
        {
            "kind": "test",
            "subject": "liner",
            "test": "wear",
            "others": ["object"],
            "inputs": inputs,
            "profiles": {"liner": found},
            "source": "a file",
        },
        {"kind": "test", "subject": missing, "test": "reference"},
    ]


def _keep(folder: Path) -> None:
    FOLDER.mkdir(parents=True)
    for name, path in DATABASES.items():
        with closing(sqlite3.connect(folder / path)) as connection:
            if name == "state":
                marks = ", ".join("?" * len(MASKED))
                connection.execute(f"DELETE FROM settings WHERE key IN ({marks})", MASKED)
                connection.commit()
            version = connection.execute("PRAGMA user_version").fetchone()[0]
            lines = [*connection.iterdump(), f"PRAGMA user_version = {version};"]
        (FOLDER / f"{name}.sql").write_text("\n".join(lines) + "\n", encoding="utf-8")
    for file in [folder / "secrets.json", *(one for small in SMALL for one in folder.glob(small))]:
        place = FOLDER / file.relative_to(folder)
        place.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(file, place)
