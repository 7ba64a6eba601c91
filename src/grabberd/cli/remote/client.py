"""What the command line asks of a running daemon.

A token comes from a file or the environment, never from the command line, which everybody on the machine can
read; it goes to the address that was named and is not taken along to another.
"""

import http.client
import json
import os
import shutil
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from grabberd.errors import GrabberdError, InputError, NotReady

TIMEOUT_S = 15.0
TOKEN_VARIABLE = "GRABBERD_TOKEN"  # noqa: S105 - its name
HINT = "it holds one line, as 'grabberd token add' prints it"


def ask(url: str, path: str, method: str = "GET", body: object = None, token_file: Path | None = None) -> Any:
    """The daemon's answer to one request.

    Raises:
        NotReady: no daemon answers there.
        InputError: there is no token in the file.
        GrabberdError: what the daemon says is wrong, with its hint.
    """
    data = None if body is None else json.dumps(body).encode()
    with _open(url, path, method, data, _token(token_file)) as answer:
        return json.load(answer)


def download(url: str, path: str, out: Path, token_file: Path | None = None) -> None:
    """Copies what the daemon answers into a file.

    Raises:
        NotReady, InputError, GrabberdError: see `ask`.
    """
    with _open(url, path, "GET", None, _token(token_file)) as answer, out.open("wb") as file:
        shutil.copyfileobj(answer, file)


class _NoRedirects(urllib.request.HTTPRedirectHandler):
    """The daemon sends nobody elsewhere, and a token is for the daemon alone."""

    def redirect_request(self, *_: Any) -> None:
        """Not followed."""


_opener = urllib.request.build_opener(_NoRedirects)


@contextmanager
def _open(
    url: str, path: str, method: str, data: bytes | None, token: str | None
) -> Iterator[http.client.HTTPResponse]:
    headers = {"Content-Type": "application/json", "Accept": "application/json"}
    if token is not None:
        headers["Authorization"] = f"Bearer {token}"
    try:
        request = urllib.request.Request(url.rstrip("/") + path, data, headers, method=method)  # noqa: S310
        with _opener.open(request, timeout=TIMEOUT_S) as answer:
            yield answer
    except urllib.error.HTTPError as error:
        raise _refusal(error) from None
    except (OSError, ValueError) as error:
        raise NotReady(f"no daemon answers at {url}: {error}", "start one: grabberd serve") from None


def _token(file: Path | None) -> str | None:
    """The token in a file, else in the environment, else none."""
    if file is None:
        return os.environ.get(TOKEN_VARIABLE, "").strip() or None
    try:
        token = file.read_text(encoding="ascii").strip()
    except (OSError, ValueError) as error:
        raise InputError(f"{file} cannot be read: {error}", HINT) from None
    if not token or len(token.split()) != 1:
        raise InputError(f"{file} has no token", HINT)
    return token


def _refusal(error: urllib.error.HTTPError) -> GrabberdError:
    try:
        problem = json.load(error)
        return GrabberdError(problem["detail"], problem["hint"])
    except (ValueError, KeyError, TypeError):
        return GrabberdError(f"the daemon answered {error.code} {error.reason}", "is it a grabberd?")
