"""Guided tests as they are stored, so that none has to be made."""

from pathlib import Path
from typing import Any

from grabberd_liner.guided_tests.documents import LinerTestDocument
from grabberd_liner.guided_tests.store import DOCUMENT, PAGE, LinerTestStore

PASSED = {
    "name": "touch",
    "title": "Opposite walls touch",
    "verdict": "passed",
    "value": 12.4,
    "sigma": 0.2,
    "unit": "kPa",
    "limit": "within the ramp",
}
FAILED = {
    "name": "mounted_radius",
    "title": "Radius as mounted",
    "verdict": "failed",
    "value": 13.6,
    "sigma": 0.05,
    "unit": "mm",
    "limit": "within 5 % of 12.5 mm",
    "reason": "The mounted radius is 13.6 mm, the profile says 12.5 mm.",
    "remedy": "Mount the liner again, or correct the radius in its profile.",
}
TPPD = {
    "name": "touch_kpa",
    "title": "touch point pressure difference",
    "definition": "difference at which opposite walls touch",
    "unit": "kPa",
    "value": 12.38,
    "sigma": 0.21,
}


def captured(capture_id: str, **labels: str) -> dict[str, Any]:
    """A capture that a test evaluated."""
    return {
        "id": capture_id,
        "captured_utc": "2026-03-01T09:30:00.000Z",
        "device": "simulated",
        "run": 1,
        "bits": 8,
        "calibration": "k",
        "object_model": "liner",
        "labels": labels,
        "profiles": [],
    }


def test_document(**changes: Any) -> LinerTestDocument:
    """A ramp of liner A that passed, with changes."""
    return LinerTestDocument.model_validate(
        {
            "kind": "ramp",
            "liner": "A",
            "captures": [captured("c1", liner="A", test="ramp")],
            "analyses": [1],
            "created_utc": "2026-03-01T09:40:00.000Z",
            "version": "0.1.0",
            "verdict": "passed",
            "checks": [PASSED],
            "quantities": [TPPD],
            **changes,
        }
    )


test_document.__test__ = False  # type: ignore[attr-defined]


def stored_test(store: LinerTestStore, number: int = 1, *, page: bool = True, **changes: Any) -> str:
    """A test in the store; returns its id."""
    test_id = f"job-{1_772_355_700 + number}"
    store.open()
    with store.scratch() as folder:
        (folder / DOCUMENT).write_text(test_document(**changes).model_dump_json(by_alias=True))
        if page:
            (folder / PAGE).write_text("<!doctype html><title>Ramp without a teat</title>")
        store.publish(test_id, folder)
    return test_id


def damage(store: LinerTestStore, test_id: str) -> Path:
    """Makes a stored test unreadable."""
    path = store.file(test_id, DOCUMENT)
    path.write_text("{")
    return path
