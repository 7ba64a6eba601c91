"""Captures of all kinds, one after the other: of given length, stopped, armed and triggered."""

import time
from collections.abc import Callable
from random import Random
from typing import Any

from .soak_clients import Host

FIELDS = (10, 400)
RUNNING_S = (0.5, 6.0)
SEALED_WITHIN_S = 60.0


def order(host: Host, random: Random, pause: Callable[[float], object]) -> str:
    """Orders a capture, waits until it is sealed, and gives its id.

    Args:
        host: the daemon.
        random: what kind and how long.
        pause: waits so many seconds, or less where all is to end.

    Raises:
        TimeoutError: it was not sealed in time.
    """
    asked, ending = random.choice([_of_length, _stopped, _armed])(random)
    capture_id = str(host.post("/api/v1/captures", asked)["id"])
    for path in ending:
        pause(random.uniform(*RUNNING_S))
        host.post(f"/api/v1/captures/{capture_id}/{path}")
    _wait_until_sealed(host, capture_id)
    return capture_id


def _of_length(random: Random) -> tuple[dict[str, Any], list[str]]:
    return {"fields": random.randint(*FIELDS), "labels": {"kind": "of length"}}, []


def _stopped(random: Random) -> tuple[dict[str, Any], list[str]]:
    return {"pre_trigger_fields": random.randint(0, 20), "labels": {"kind": "stopped"}}, ["stop"]


def _armed(random: Random) -> tuple[dict[str, Any], list[str]]:
    length = {"pre_trigger_fields": random.randint(0, 25), "post_trigger_fields": random.randint(*FIELDS)}
    return {"armed": True, **length, "labels": {"kind": "armed"}}, ["trigger"]


def _wait_until_sealed(host: Host, capture_id: str) -> None:
    until = time.monotonic() + SEALED_WITHIN_S
    while host.json(f"/api/v1/captures/{capture_id}")["verdict"] is None:
        if time.monotonic() > until:
            raise TimeoutError(f"capture {capture_id} was not sealed within {SEALED_WITHIN_S:.0f} s")
        time.sleep(0.1)
