"""What today's service finds in the kept state directory: its answers, and the jobs that it takes up."""

import json
import sqlite3
import tempfile
from collections.abc import Iterator
from contextlib import closing
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

from fastapi.testclient import TestClient

from .doors import Outbox, Service, create_app, opened
from .exits import grabberd_root
from .kept import canonical, digest, plain
from .state import API, DATABASES, KEY, ONCE, restore, secrets

LATER = timedelta(hours=3)
"""Time after it was made at which the state is opened: one of the tokens has expired since."""
LONGEST = 4000
"""Characters of an answer that is kept whole; of a longer one, the digest of each part is."""
PATHS = (
    *("settings", "config", "session", "captures", "captures/liner", "captures/object", "captures.csv"),
    *("captures?pinned=true", "captures?label=cow=example-112", "captures/liner/analyses"),
    *("captures/object/analyses", "profiles", "profiles/liner/example-reference", "profiles/cow/example-112"),
    *("profiles/cow/example-112/versions", "profiles/cow/example-112/versions/1", "profiles/cow/once"),
    *("profiles/cup/example-simulated", "profiles/pulsator/example-simulated", "calibrations"),
    *("calibrations/stored-active", "calibrations/stored-rejected", "calibrations/nothing", "tests"),
    *("tests/test-kept", "tests/recipes", "jobs", "jobs/job-99"),
    *("calibration-frames", "devices/simulated/object", "study?captures=object"),
)
CLOCKS = {"age_days": "", "created_utc": "study"}
"""Keys whose values the clock decides on, and how the paths begin whose answers they are masked in."""


def state() -> dict[str, Any]:
    """Answers over HTTP, rows of the queue as they are after opening it, and jobs in their turn."""
    known = secrets()
    now_utc = (datetime.fromisoformat(known["made_utc"]) + LATER).isoformat()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        restore(folder)
        with opened(folder, now_utc) as service:
            answers = _answers(service, folder, known)
            rows = _rows(folder)
            taken = list(_taken_up(service))
        outbox = Outbox(folder / DATABASES["state"])
        waits = [sorted(outbox.entered()), outbox.first()]
    return {"answers": answers, "queue": rows, "taken_up": taken, "outbox": plain(waits)}


def _answers(service: Service, folder: Path, known: dict[str, str]) -> dict[str, Any]:
    client = TestClient(create_app(service), "http://localhost", raise_server_exceptions=False)
    masks = {str(folder): "FOLDER", str(grabberd_root()): "ROOT"}

    def answer(method: str, path: str, who: str, **how: Any) -> dict[str, Any]:
        headers = {"Cookie": known["cookie"]} if who == "cookie" else _bearer(known.get(who))
        got = client.request(method, f"{API}/{path}", headers={**headers, **how.pop("headers", {})}, **how)
        text = got.text
        for one, mask in masks.items():
            text = text.replace(one, mask)
        is_json = "json" in got.headers.get("content-type", "")
        shown = {"status": got.status_code, "location": got.headers.get("location"), "body": text}
        if is_json:
            masked = {key for key, start in CLOCKS.items() if path.startswith(start)}
            shown["body"] = _shown(_masked(json.loads(text), masked))
        return {key: value for key, value in shown.items() if value is not None}

    found = {path: answer("GET", path, "admin") for path in PATHS}
    for job in service.jobs.list():
        found[f"jobs/{job.id}"] = answer("GET", f"jobs/{job.id}", "admin")
    for who in ("viewer", "operator", "admin", "brief", "cookie", "nobody"):
        found[f"session of {who}"] = answer("GET", "session", who)
        found[f"config for {who}"] = {"status": answer("GET", "config", who)["status"]}
    found["repeated"] = answer("POST", "profiles", "admin", json=ONCE, headers=KEY)
    other = {"profile": {**ONCE["profile"], "lactation": 2}}
    found["repeated with another body"] = answer("POST", "profiles", "admin", json=other, headers=KEY)
    found["deletion of what is pinned"] = answer("DELETE", "captures/liner", "admin")
    return found


def _bearer(secret: str | None) -> dict[str, str]:
    return {} if secret is None else {"Authorization": f"Bearer {secret}"}


def _masked(value: Any, keys: set[str]) -> Any:
    if isinstance(value, dict):
        return {key: "…" if key in keys else _masked(one, keys) for key, one in value.items()}
    return [_masked(one, keys) for one in value] if isinstance(value, list) else value


def _shown(value: Any) -> Any:
    if isinstance(value, dict) and len(canonical(value)) > LONGEST:
        return {
            key: one if len(canonical(one)) < LONGEST else digest(canonical(one))
            for key, one in value.items()
        }
    return value


def _rows(folder: Path) -> list[Any]:
    """Every row of the queue; parameters by their keys, long ones by their digests."""
    with closing(sqlite3.connect(folder / DATABASES["queue"])) as connection:
        connection.row_factory = sqlite3.Row
        rows = [dict(row) for row in connection.execute("SELECT * FROM jobs ORDER BY number")]
        lost = [list(row) for row in connection.execute("SELECT * FROM unanalysed")]
    for row in rows:
        row["parameters"] = _parameters(json.loads(row["parameters"] or "null"))
    return [*rows, lost]


def _taken_up(service: Service) -> Iterator[dict[str, Any]]:
    """The jobs that wait, each begun as the runner would begin it."""
    for _ in range(sum(one.state == "queued" for one in service.jobs.list())):
        entry = service.jobs.first(lambda: False)
        assert entry is not None
        begun = service.jobs.begin(entry.number)
        assert begun is not None
        assert begun.spec is not None
        yield {
            "kind": begun.spec.kind,
            "subject": begun.spec.subject,
            "captures": list(begun.spec.captures),
            "analyses": list(begun.spec.analyses),
            "attempts": begun.job.attempts,
            "automatic": begun.job.automatic,
            "parameters": _parameters(json.loads(begun.spec.model_dump_json())),
        }


def _parameters(found: Any) -> Any:
    if not isinstance(found, dict):
        return found
    return {key: one if len(json.dumps(one)) < 200 else digest(json.dumps(one)) for key, one in found.items()}
