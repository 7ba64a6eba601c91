"""What is told over MQTT: on which topics, and in which words. Nothing else."""

from collections.abc import Mapping
from typing import Any, NamedTuple
from urllib.parse import quote

from grabberd.acquisition import Outcome

SCHEMA = 1
"""Of all documents; a further key does not change it, another meaning does."""


class Topic(NamedTuple):
    """A topic below PREFIX/BARN: whether the broker retains its latest document, and what that says."""

    name: str
    retained: bool
    words: str


ONLINE = Topic("online", True, "whether the daemon is connected; `false` is its last will")
STATE = Topic("devices/{device}/state", True, "how a device is")
CAPTURE = Topic("captures", False, "the summary of a capture that has ended")
TOPICS = (ONLINE, STATE, CAPTURE)


class Message(NamedTuple):
    """A document and its topic. All go out with QoS 1."""

    topic: str
    document: Mapping[str, Any]
    retained: bool


class Topics:
    """The topics of one barn.

    Args:
        prefix: of every topic.
        barn: its name, in which what is no letter or digit becomes %XX, as in a data set's folders.
    """

    def __init__(self, prefix: str, barn: str) -> None:
        self._start = f"{prefix}/{quote(barn, safe='')}"

    def message(self, topic: Topic, document: Mapping[str, Any], **parts: str) -> Message:
        """A document on its topic, and which schema it has."""
        name = f"{self._start}/{topic.name.format(**parts)}"
        return Message(name, {"schema": SCHEMA, **document}, topic.retained)


def device_state(device: Mapping[str, Any], storage: Mapping[str, Any]) -> dict[str, Any]:
    """How a device is, in short; numbers that always waver are rounded until they are quiet.

    Args:
        device: as `device_document` shows it.
        storage: the disk, as `DiskGuard.document` shows it.
    """
    calibration, rig, rate_hz = device["calibration"], device["rig"], device["rate_hz"]
    lacks = {one["lacks"] for one in device["lacks"]}
    others = [outcome for outcome in Outcome if outcome is not Outcome.RECEIVED]
    return {
        "device": device["name"],
        "state": device["state"],
        "since_utc": device["since_utc"],
        "cause": device["cause"],
        "cause_code": device["cause_code"],
        "signal": device["signal"],
        "rate_hz": None if rate_hz is None else round(rate_hz),
        **{f"fields_{outcome}": device["fields"][outcome] for outcome in others},
        "calibration_id": calibration["id"] if calibration else None,
        "calibration_fits": "calibration" not in lacks if calibration else None,
        "rig": rig["verdict"] if rig else None,
        "capture_id": device["capture_id"],
        "disk_minutes_left": _two_digits(storage["minutes_left"]),
    }


def capture_summary(
    document: Mapping[str, Any],
    *,
    file: str,
    site: Mapping[str, str],
    rate_hz: float,
    calibration_id: str | None,
) -> dict[str, Any]:
    """What a capture has become; its id is the key by which a receiver knows one that came twice.

    Args:
        document: as the archive shows it.
        file: its name.
        site: where it was recorded.
        rate_hz: fields a second.
        calibration_id: what its latest points were measured with, None without points.
    """
    counts, group = document["ledger"]["counts"], document["group"]
    return {
        "capture_id": document["id"],
        "group_id": group["id"] if group else None,
        "device": document["device"],
        "state": document["state"],
        "verdict": document["verdict"],
        "ended_because": document["ended_because"],
        "started_utc": document["created_utc"],
        "duration_s": round(sum(counts.values()) / rate_hz, 3),
        "fields": document["fields"],
        "ledger": {"in_words": document["ledger"]["in_words"], "counts": counts},
        "bits": document["bits"],
        "lines": document["lines"],
        "labels": document["labels"],
        "site": dict(site),
        "calibration_id": calibration_id,
        "file": file,
        "size_bytes": document["size_bytes"],
    }


def _two_digits(value: float | None) -> float | None:
    return None if value is None else float(f"{value:.2g}")
