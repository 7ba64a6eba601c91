"""What the command line asks of a running daemon."""

import json
import time
import urllib.error
import urllib.request
from pathlib import Path
from typing import Any

from grabberd.errors import GrabberdError, NotReady

TIMEOUT_S = 15.0
POLL_S = 0.2


def ask(url: str, path: str, method: str = "GET", body: object = None) -> Any:
    """The daemon's answer to one request.

    Raises:
        NotReady: no daemon answers there.
        GrabberdError: what the daemon says is wrong, with its hint.
    """
    data = None if body is None else json.dumps(body).encode()
    headers = {"Content-Type": "application/json", "Accept": "application/json"}
    try:
        request = urllib.request.Request(url.rstrip("/") + path, data, headers, method=method)  # noqa: S310
        with urllib.request.urlopen(request, timeout=TIMEOUT_S) as answer:  # noqa: S310
            return json.load(answer)
    except urllib.error.HTTPError as error:
        raise _refusal(error) from None
    except (OSError, ValueError) as error:
        raise NotReady(f"no daemon answers at {url}: {error}", "start one: grabberd serve") from None


def _refusal(error: urllib.error.HTTPError) -> GrabberdError:
    try:
        problem = json.load(error)
        return GrabberdError(problem["detail"], problem["hint"])
    except (ValueError, KeyError):
        return GrabberdError(f"the daemon answered {error.code} {error.reason}", "is it a grabberd?")


def capture_through(url: str, device: str | None, order: dict[str, Any], out: Path) -> dict[str, Any]:
    """Has the daemon make a capture of given length, and copies its file.

    Raises:
        GrabberdError: what the daemon says is wrong.
    """
    if "fields" not in order and "duration_s" not in order:
        raise NotReady("a capture through the daemon needs a length here", "give --fields or --duration-s")
    started = ask(url, "/api/v1/captures", "POST", {**order, "device": device})
    document = started
    while document["state"] in ("recording", "sealing"):
        time.sleep(POLL_S)
        document = ask(url, f"/api/v1/captures/{started['id']}")
    urllib.request.urlretrieve(f"{url.rstrip('/')}/api/v1/captures/{started['id']}/file", out)  # noqa: S310
    return dict(document)
