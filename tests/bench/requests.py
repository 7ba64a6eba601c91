"""Processor time of a request to the daemon, beside that of a bare server in the same run."""

import http.client
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import NamedTuple

from tests.faults.daemon import RECORDED, running
from tests.faults.failing import configuration

IDLE_S = 2.0


class Pace(NamedTuple):
    """How often a request is sent."""

    rounds: int
    requests: int
    pause_s: float


ONE_AFTER_THE_OTHER = Pace(7, 200, 0.0)
SELDOM = Pace(3, 80, 0.12)
BARE = """
import uvicorn
from starlette.applications import Starlette
from starlette.responses import JSONResponse
from starlette.routing import Route
app = Starlette(routes=[Route("/", lambda _: JSONResponse({"status": "ok"}))])
uvicorn.run(app, port=0, access_log=False)
"""
PATHS = {
    "health": "/healthz",
    "state": "/api/v1/state",
    "settings": "/api/v1/settings",
    "points of the newest field": "/api/v1/devices/cup/points",
    "list of captures": "/api/v1/captures",
    "points of a recorded field": "/api/v1/captures/{capture}/points?first_n=0&end_n=1",
    "picture of a recorded field": "/api/v1/captures/{capture}/fields/1.png",
}


def table() -> str:
    """Milliseconds a request, least of all rounds; of the process for contents, too."""
    with _bare() as (pid, port):
        peer_ms = _least(pid, port, "/")
    rows = [
        "| request | processor time, ms | of a bare Starlette application's |",
        "|---|---|---|",
        f"| bare Starlette application, one line of JSON | {peer_ms:.2f} | 1 |",
    ]
    with tempfile.TemporaryDirectory() as folder, running(Path(folder), configuration(), RECORDED) as daemon:
        daemon.wait_until_ready()
        capture = daemon.start_capture(fields=20)
        daemon.sealed(capture)
        for name, path in PATHS.items():
            ms = _least(daemon.process.pid, daemon.port, path.format(capture=capture))
            rows.append(f"| {name} | {ms:.2f} | {ms / peer_ms:.1f} |")
        ms = _least(daemon.process.pid, daemon.port, PATHS["state"], SELDOM)
        rows.append(f"| state, asked for so seldom that each is made | {ms:.2f} | {ms / peer_ms:.1f} |")
    return "\n".join(rows)


@contextmanager
def _bare() -> Iterator[tuple[int, int]]:
    with subprocess.Popen([sys.executable, "-c", BARE], stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        line = next(line for line in process.stderr if "running on" in line)
        try:
            yield process.pid, int(line.split(":")[-1].split()[0])
        finally:
            process.kill()


def _least(pid: int, port: int, path: str, pace: Pace = ONE_AFTER_THE_OTHER) -> float:
    with closing(http.client.HTTPConnection("127.0.0.1", port, timeout=60)) as connection:
        return min(_round_ms(pid, connection, path, pace) for _ in range(pace.rounds))


def _round_ms(pid: int, connection: http.client.HTTPConnection, path: str, pace: Pace) -> float:
    """Cost of a request, without what the process costs in the same time while nobody asks."""
    before_s, began_s = processor_s(pid), time.monotonic()
    time.sleep(IDLE_S + pace.requests * pace.pause_s)
    share = (processor_s(pid) - before_s) / (time.monotonic() - began_s)
    connection.close()  # by now the daemon may have closed it
    _ask(connection, path)
    before_s, began_s = processor_s(pid), time.monotonic()
    for _ in range(pace.requests):
        time.sleep(pace.pause_s)
        _ask(connection, path)
    idle_s = share * (time.monotonic() - began_s)
    return (processor_s(pid) - before_s - idle_s) / pace.requests * 1e3


def _ask(connection: http.client.HTTPConnection, path: str) -> None:
    connection.request("GET", path)
    response = connection.getresponse()
    response.read()
    assert response.status == 200, (path, response.status)


def processor_s(pid: int) -> float:
    """Of a process and those that it has started."""
    children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    ticks = 0
    for one in (pid, *children):
        times = Path(f"/proc/{one}/stat").read_text().rpartition(")")[2].split()
        ticks += int(times[11]) + int(times[12])
    return ticks / os.sysconf("SC_CLK_TCK")
