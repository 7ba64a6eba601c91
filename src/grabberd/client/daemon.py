"""The client of a running daemon.

A command takes its token from a file or the environment, never from the command line, which every user of the
machine can read. It is sent only to the given address and never follows a redirect.
"""

import http.client
import json
import os
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import urlencode

from grabberd.errors import GrabberdError, InputError, NotReady
from grabberd.files.disk import scratch_folder, storage_errors

TIMEOUT_S = 15.0
_PART_BYTES = 1 << 16
LARGEST_ANSWER, LARGEST_REFUSAL = 128 << 20, 1 << 20
"""Bytes of a document that is taken, twice what a daemon has room for, and of a refusal."""
LONGEST_PAGE = 500
CAPTURES = "/api/v1/captures"
UNENDED = ("armed", "recording", "sealing")
"""States of a capture that is still to end."""
POLL_S = 0.2
"""Time after which a daemon is asked again."""
TOKEN_VARIABLE = "GRABBERD_TOKEN"  # noqa: S105 - its name
HINT = "it must hold one line, as printed by 'grabberd token add'"


class Daemon(NamedTuple):
    """A daemon at an address, asked with a token, that in a file, or that in the environment, if any.

    All requests raise NotReady if no daemon answers there, InputError if there is no token in the file, and
    GrabberdError with the daemon's own error message and hint.
    """

    url: str
    token_file: Path | None = None
    given_token: str | None = None

    @property
    def token(self) -> str | None:
        """The token to ask with, or None.

        Raises:
            InputError: There is none in the file.
        """
        return self.given_token or token_of(self.token_file)

    def ask(self, path: str, method: str = "GET", body: object = None, timeout_s: float = TIMEOUT_S) -> Any:
        """Send one request and return the daemon's answer."""
        data = None if body is None else json.dumps(body).encode()
        with self._open(path, method, data, timeout_s) as answer:
            content = answer.read(LARGEST_ANSWER + 1)
        if len(content) > LARGEST_ANSWER:
            asked = self.url + path.partition("?")[0]
            raise GrabberdError(
                f"the answer to {asked} has more than {LARGEST_ANSWER >> 20} MB",
                "check that the address is that of a grabberd daemon, or ask for less at once",
            )
        return json.loads(content)

    def rows(
        self,
        path: str,
        name: str,
        *query: tuple[str, str],
        page: int | None = None,
        timeout_s: float = TIMEOUT_S,
    ) -> Iterator[Any]:
        """The rows of a list, asked for page by page.

        Args:
            path: What to ask for.
            name: Key of the rows in each page.
            *query: Keys and values of the query.
            page: Maximum number of rows of a page; default: the longest that the API gives.
            timeout_s: Time for a page.
        """
        following: list[tuple[str, str]] = []
        while True:
            asked = urlencode([("limit", str(page or LONGEST_PAGE)), *query, *following])
            found = self.ask(f"{path}?{asked}", timeout_s=timeout_s)
            yield from found[name]
            if not found.get("next"):
                return
            following = [("cursor", found["next"])]

    def download(self, path: str, out: Path, check: Callable[[Path], None] | None = None) -> None:
        """Save the daemon's answer to a file, which has its name only once it is whole.

        Args:
            path: What to ask for.
            out: The file.
            check: Reads the whole file and raises an error if it is not what was asked for.

        Raises:
            NotReady: The answer broke off.
            StorageError: The file cannot be written.
        """
        with scratch_folder(out.parent) as folder:
            whole = folder / out.name
            with self._open(path, "GET", None) as answer:
                _save(answer, whole, self.url)
            if check is not None:
                check(whole)
            with storage_errors(out):
                whole.rename(out)

    @contextmanager
    def _open(
        self, path: str, method: str, data: bytes | None, timeout_s: float = TIMEOUT_S
    ) -> Iterator[http.client.HTTPResponse]:
        headers = {"Content-Type": "application/json", "Accept": "application/json"}
        if token := self.token:
            headers["Authorization"] = f"Bearer {token}"
        address = self.url.rstrip("/") + path
        try:
            request = urllib.request.Request(address, data, headers, method=method)  # noqa: S310
            with _opener.open(request, timeout=timeout_s) as answer:
                yield answer
        except urllib.error.HTTPError as error:
            raise refusal_of(error.read(LARGEST_REFUSAL), f"{error.code} {error.reason}") from None
        except (OSError, ValueError) as error:
            raise NotReady(f"no daemon answers at {self.url}: {error}", "start one: grabberd serve") from None


def _save(answer: http.client.HTTPResponse, out: Path, url: str) -> None:
    expected, saved = answer.length, 0
    with storage_errors(out):
        file = out.open("wb")
    with file:
        # An error of the connection is not one of the disk: only writing stands inside `storage_errors`.
        while part := answer.read(_PART_BYTES):
            saved += len(part)
            with storage_errors(out):
                file.write(part)
    if expected is not None and saved != expected:
        hint = "try again; the daemon still has all of it"
        raise NotReady(f"the answer of {url} broke off after {saved} of {expected} bytes", hint)


class _NoRedirects(urllib.request.HTTPRedirectHandler):
    """Handler that refuses redirects: the daemon sends none, and a token is for the daemon alone."""

    def redirect_request(self, *_: Any) -> None:
        """Return None, so that the redirect becomes an error."""


_opener = urllib.request.build_opener(_NoRedirects)


def token_of(file: Path | None) -> str | None:
    """The token in a file, else that in the environment, if any.

    Raises:
        InputError: There is none in the file.
    """
    if file is None:
        return os.environ.get(TOKEN_VARIABLE, "").strip() or None
    try:
        token = file.read_text(encoding="ascii").strip()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"{file} cannot be read: {reason}", HINT) from None
    if not token or len(token.split()) != 1:
        raise InputError(f"{file} contains no token", HINT)
    return token


def refusal_of(body: bytes, status: str) -> GrabberdError:
    """The error that a daemon answered with.

    Args:
        body: What it said.
        status: Status of the answer.
    """
    try:
        problem = json.loads(body)
        return GrabberdError(problem["detail"], problem["hint"])
    except (ValueError, KeyError, TypeError):
        return GrabberdError(
            f"the daemon answered {status}", "check that the address is that of a grabberd daemon"
        )
