"""What the installer asks of a release before and after it takes the place of another.

release_checks.py imports                         whether all of the daemon can be imported
release_checks.py state-directory CONFIG          where that configuration has the state
release_checks.py state FILE                      whether the release opens a copy of this state database
release_checks.py answers LISTEN VERSION SECONDS  whether a daemon answers in time, and as that version

The first three run in the release's own Python, the last one in any.
"""

import contextlib
import http.client
import importlib
import json
import re
import sqlite3
import ssl
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

IMPORTED = (
    "grabberd.server.api",
    "grabberd.cli.app",
    "grabberd.server.daemon.service",
    "grabberd_liner.analyses.job",
    "grabberd_liner.chain.analysis.analyse",
    "grabberd_fake",
    "grabberd_replay",
    "grabberd_v4l2",
)
ASKED_EVERY_S, ANSWER_S = 0.2, 5.0


def imports() -> None:
    """Imports the daemon, its jobs and its drivers."""
    for name in IMPORTED:
        importlib.import_module(name)


def state_directory(config: str) -> None:
    """Prints where a configuration has the state."""
    from grabberd.config import load_config  # noqa: PLC0415

    print(load_config(Path(config)).state_directory)


def state(file: str) -> None:
    """Opens and migrates a copy, which a daemon may be writing meanwhile."""
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "state.sqlite"
        source = sqlite3.connect(f"{Path(file).absolute().as_uri()}?mode=ro", uri=True)
        with contextlib.closing(source), contextlib.closing(sqlite3.connect(copy)) as target:
            source.backup(target)
        _state_database()(copy).open()


def _state_database() -> Any:
    """The release's class; one that a rollback goes back to may be so old that it lies elsewhere."""
    try:
        module = importlib.import_module("grabberd.archive.state.state_database")
    except ModuleNotFoundError as error:
        if error.name != "grabberd.archive":
            raise
        module = importlib.import_module("grabberd.storage.state.state_database")
    return module.StateDatabase


def answers(listen: str, version: str, seconds: str) -> None:
    """Asks /healthz until it answers as it has to.

    Raises:
        TimeoutError: It does not in time; with the last answer.
    """
    address = address_of(listen)
    until, said = time.monotonic() + float(seconds), "nothing was asked"
    while time.monotonic() < until:
        said = _health(*address)
        if said == f"version {version}" or (not version and said.startswith("version ")):
            return
        time.sleep(ASKED_EVERY_S)
    raise TimeoutError(f"{address[0]}:{address[1]}: {said}, not version {version or 'of any kind'}")


def address_of(listen: str) -> tuple[str, int]:
    """The address of a socket unit as systemctl shows it, such as `[::]:8050 (Stream)`.

    Raises:
        ValueError: It has none.
    """
    found = re.search(r"(\S+):(\d+) \(Stream\)", listen)
    if found is None:
        raise ValueError(f"grabberd.socket listens on no port: {listen!r}")
    host = found[1].strip("[]")
    return "127.0.0.1" if host in ("::", "0.0.0.0", "*") else host, int(found[2])  # noqa: S104


def _health(host: str, port: int) -> str:
    """What a daemon says of itself, with TLS or without, or why it does not."""
    said = ""
    for secure in (False, True):
        try:
            status, body = _asked(host, port, secure)
            document = json.loads(body)
            return f"version {document.get('version')}" if status == 200 else f"status {status}"
        except (OSError, ValueError, http.client.HTTPException) as error:
            said = said or f"{type(error).__name__}: {error}"
    return said


def _asked(host: str, port: int, secure: bool) -> tuple[int, bytes]:
    if secure:
        # Whose certificate it is does not matter: nothing is told, and the answer is only a version.
        context = ssl._create_unverified_context()  # noqa: S323
        connection: http.client.HTTPConnection = http.client.HTTPSConnection(
            host, port, timeout=ANSWER_S, context=context
        )
    else:
        connection = http.client.HTTPConnection(host, port, timeout=ANSWER_S)
    with contextlib.closing(connection):
        connection.request("GET", "/healthz")
        answer = connection.getresponse()
        return answer.status, answer.read(10_000)


def main(name: str, *arguments: str) -> None:
    """Runs one check; what it finds wrong is one sentence."""
    checks = {"imports": imports, "state-directory": state_directory, "state": state, "answers": answers}
    try:
        checks[name](*arguments)  # type: ignore[operator]
    except Exception as error:
        sys.exit(f"grabberd: {name}: {type(error).__name__}: {error}")


if __name__ == "__main__":
    main(*sys.argv[1:])
