"""Random sequences of valid and invalid requests to the real application, over a folder of hostile captures.

    python -m proofs.fuzz.http_requests SAMPLES SEED [COUNT]

What is done before is remembered: ids of captures, jobs and calibrations come back in later requests,
each sent by a stranger, a viewer, an operator or an admin. An error of the daemon itself, an exception in its
log, or a health that does not answer is a finding.
"""

import json
import logging
import re
import shutil
import sys
import tempfile
import warnings
from pathlib import Path
from random import Random
from typing import Any

from fastapi.testclient import TestClient
from running import wait_until_it_accepts

from grabberd.documents.enums import Role
from grabberd.errors import GrabberdError
from grabberd.server.api import create_app
from grabberd.server.api.guard.authentication import least_roles
from proofs.fuzz.mutation import CELLS, changed
from proofs.fuzz.targets import prepare
from server.api.conftest import service_in

REQUESTS = 300
HOSTILE_CAPTURES = 8
ENDLESS = ("GET /api/v1/events", "WEBSOCKET /api/v1/preview", "GET /static/{version}/{path:path}")
EXPLAINED = (501, 503, 507)
"""Server errors that are documented: an extra, the device or the disk is missing."""
BODIES: dict[str, list[Any]] = {
    "/captures": [
        {"fields": 5},
        {"fields": 3, "labels": {"cow": "1"}, "trigger": "manual"},
        {"bits": 8, "fields": 2},
    ],
    "/capture-groups": [{"fields": 2}, {"devices": ["simulated"], "fields": 1}],
    "/settings": [{"threshold": 60}, {"threshold": "automatic"}, {"light": {}}],
    "/active": [{"id": "rig-7"}, {"calibration": "rig-7"}],
    "/measure": [{}, {"calibration": "rig-7"}],
    "/analysis": [
        {},
        {"inputs": {"reference": {"field": 0}}, "vacuum_log": "time_s,pulsation_vacuum_kpa\n0,42\n"},
    ],
    "/profiles": [
        {"yaml": "kind: cow\nname: '112'\n"},
        {"profile": {"kind": "liner", "name": "A", "material": {"E_mpa": 3.0}}, "after": 0},
    ],
    "/session": [{"token": "x"}],
    "/trigger": [{}],
    "/stop": [{}],
    "/check": [{}],
    "/identification": [{}, {"marks": [{"view": "left", "target": 1, "x_px": 5, "y_px": 6}]}],
    "/rejection": [{"reason": "wrong"}, {}],
    "": [{"note": "x", "pinned": True}, {"labels": {"cow": "2"}}],
}
QUERIES = (
    "run",
    "from",
    "to",
    "every",
    "limit",
    "since",
    "until",
    "cursor",
    "label",
    "field",
    "fields",
    "n",
    "format",
    "raw",
)
ODD = (
    "",
    "..",
    "%2e%2e",
    "a" * 300,
    "é",
    "\0",
    "-1",
    "0",
    "1e9",
    "nan",
    "null",
    "9" * 400,
    "a/b",
    "'; --",
    "%00",
    "²",
)


class _Findings(logging.Handler):
    """Errors in the log that carry an exception."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.found: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        if record.exc_info and not _broke_off(record.exc_info[1]):
            self.found.append(logging.Formatter().format(record))


def _broke_off(error: BaseException | None) -> bool:
    """True if a download ended where its capture is damaged: its status had been sent."""
    return isinstance(error, RuntimeError) and isinstance(error.__cause__, GrabberdError)


class Client:
    """Somebody who asks at random, and remembers what there is."""

    def __init__(self, random: Random, client: TestClient, secrets: dict[str, str]) -> None:
        self._random, self._client, self._secrets = random, client, secrets
        self._ids: dict[str, list[str]] = {}

    def ask(self) -> str | None:
        """One request; what is wrong with its answer, or None."""
        method, _, path = self._random.choice([key for key in least_roles() if key not in ENDLESS]).partition(
            " "
        )
        url = re.sub(r"{(\w+)[^}]*}", lambda match: self._value(match[1]), path)
        answer = self._client.request(
            method,
            url.replace("\0", "%00"),
            params=self._query() if self._random.random() < 0.5 else None,
            content=self._body(path) if method in ("POST", "PUT", "PATCH") else None,
            headers=self._headers(),
        )
        self._remember(path, answer)
        if answer.status_code >= 500 and answer.status_code not in EXPLAINED:
            return f"{method} {answer.request.url}: {answer.status_code} {answer.text[:500]}"
        return None

    def _value(self, name: str) -> str:
        known = self._ids.get(name, [])
        if known and self._random.random() < 0.8:
            return self._random.choice(known)
        numbers = name in ("n", "run", "number") and self._random.random() < 0.7
        return str(self._random.randrange(6)) if numbers else self._random.choice(ODD)

    def _query(self) -> dict[str, str]:
        names = self._random.sample(QUERIES, self._random.randint(1, 3))
        return {name: self._random.choice((*ODD, "0", "1", "5", "2026-01-01T00:00:00Z")) for name in names}

    def _body(self, path: str) -> bytes:
        ending = next(one for one in BODIES if path.endswith(one))
        document = json.dumps(self._with_ids(self._random.choice(BODIES[ending])))
        if self._random.random() < 0.5:
            return document.encode()
        return changed(self._random, document.encode(), [document.encode(), b'{"a": [1, {"b": null}]}'])

    def _with_ids(self, document: dict[str, Any]) -> dict[str, Any]:
        if document and self._random.random() < 0.3:
            value = self._random.choice([cell for cell in CELLS if not isinstance(cell, bytes | float)])
            document = {**document, self._random.choice(list(document)): value}
        return document

    def _headers(self) -> dict[str, str]:
        headers = {"Content-Type": self._random.choice(("application/json",) * 8 + ("text/csv", "a"))}
        if (who := self._random.choice((*self._secrets, "nobody"))) != "nobody":
            headers["Authorization"] = f"Bearer {self._secrets[who]}"
        if self._random.random() < 0.2:
            headers["Idempotency-Key"] = self._random.choice(("one", "two", "a" * 300))
        if self._random.random() < 0.1:
            headers["Range"] = self._random.choice(
                ("bytes=0-5", "bytes=-1", "bytes=9-", "bytes=" + "0-1," * 500)
            )
        return headers

    def _remember(self, path: str, answer: Any) -> None:
        kinds = {
            "/captures": "capture_id",
            "/jobs": "job_id",
            "/calibrations": "calibration_id",
            "/devices": "name",
        }
        kinds["/capture-groups"] = "group_id"
        for ending, name in kinds.items():
            if path.endswith(ending) and answer.status_code < 300:
                ids = re.findall(r'"(?:id|name)": ?"([^"]+)"', answer.text)
                self._ids[name] = list({*self._ids.get(name, []), *ids})[-30:]


def main(samples: str, seed: str, count: str = str(REQUESTS)) -> int:
    """Returns the number of findings."""
    random, findings = Random(int(seed)), _Findings()
    warnings.simplefilter("ignore")
    logging.getLogger().addHandler(findings)
    with tempfile.TemporaryDirectory(prefix="fuzz-") as folder:
        _fill(random, Path(samples), Path(folder))
        service = service_in(Path(folder), pace="free")
        service.open_stores()
        secrets = {role: service.access.add(role, role) for role in Role}
        with TestClient(create_app(service), "http://localhost", raise_server_exceptions=False) as client:
            wait_until_it_accepts(service)
            asking = Client(random, client, secrets)
            for _ in range(int(count)):
                if (wrong := asking.ask()) is not None:
                    findings.found.append(wrong)
            if client.get("/healthz").status_code != 200:
                findings.found.append("health does not answer")
    print("\n".join(findings.found), file=sys.stderr)
    return len(findings.found)


def _fill(random: Random, samples: Path, folder: Path) -> None:
    """Puts hostile captures where the daemon finds them, and one that is whole."""
    captures = folder / "captures"
    captures.mkdir()
    shutil.copy(samples / "capture" / "liner.grab", captures)
    for number in range(HOSTILE_CAPTURES):
        prepare(random, samples, "capture", captures / f"hostile-{number}.grab")


if __name__ == "__main__":
    sys.exit(min(main(*sys.argv[1:]), 1))
