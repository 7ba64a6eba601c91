"""Example documents for the OpenAPI description."""

from grabberd.documents.document import JsonObject

_ID = "20260301T093000125Z-barn"

_MISSING = "2 of 64 fields could not be measured: lost, damaged or without a picture"
_COVERAGE: JsonObject = {
    "verdict": "measured_with_gaps",
    "in_words": _MISSING,
    "findings": [
        {
            "verdict": "measured_with_gaps",
            "code": "fields_missing",
            "values": {"missing": 2, "fields": 64},
            "miss": None,
            "in_words": _MISSING,
        }
    ],
    "share": 0.9987,
    "fields": 62,
    "missing_fields": 2,
    "residual_px": 0.094,
    "residual_sigma": 0.97,
}
CAPTURE: JsonObject = {
    "id": _ID,
    "device": "barn",
    "state": "sealed",
    "verdict": "incomplete",
    "ended_because": "length reached",
    "created_utc": "2026-03-01T09:30:00.125Z",
    "trigger_utc": "2026-03-01T09:30:00.125Z",
    "pre_trigger_fields": 0,
    "bits": 1,
    "lines": "doubled",
    "rate_hz": 50.0,
    "fields": 62,
    "ledger": {
        "complete": False,
        "in_words": "2 fields lost at 0.34 s (time gap)",
        "counts": {"received": 62, "lost": 2, "damaged": 0, "no_signal": 0, "overrun": 0},
        "entries": [{"first_n": 17, "count": 2, "outcome": "lost", "reason": "time gap", "cause": "cable"}],
        "events": [],
    },
    "runs": [
        {
            "run": 1,
            "kind": "live",
            "created_utc": "2026-03-01T09:30:00.125Z",
            "version": "0.1.0",
            "state": "done",
            "coverage": _COVERAGE,
        }
    ],
    "coverage": _COVERAGE,
    "analysis": {
        "state": "done",
        "job": None,
        "analysis": 1,
        "created_utc": "2026-03-01T09:31:12.310Z",
        "quantities": [
            {
                "name": "liner_compression_mean_kpa",
                "unit": "kPa",
                "value": 11.8,
                "sigma": 1.1,
                "sigma_common": 1.0,
                "verdict": "",
                "reason": "",
            },
            {
                "name": "rate_per_min",
                "unit": "1/min",
                "value": 60.2,
                "sigma": 0.1,
                "sigma_common": 0.0,
                "verdict": "",
                "reason": "",
            },
        ],
        "problem": None,
    },
    "labels": {"cow": "112", "teat": "front left"},
    "note": "new liners",
    "pinned": False,
    "size_bytes": 94208,
}
POINTS: JsonObject = {
    "capture": _ID,
    "run": 1,
    "every": 1,
    "fields": [
        {
            "n": 0,
            "time_s": 0.0,
            "target": [14],
            "x_mm": [-3.271],
            "y_mm": [6.482],
            "z_mm": [11.905],
            "sigma_x_mm": [0.041],
            "sigma_y_mm": [0.038],
            "sigma_z_mm": [0.092],
            "calibration_sigma_x_mm": [0.008],
            "calibration_sigma_y_mm": [0.007],
            "calibration_sigma_z_mm": [0.019],
            "residual_px": [0.11],
        }
    ],
}
JOB: JsonObject = {
    "id": "job-1764000003",
    "kind": "measure",
    "subject": _ID,
    "automatic": False,
    "state": "running",
    "position": None,
    "attempts": 1,
    "created_utc": "2026-03-01T10:02:11.480Z",
    "ended_utc": None,
    "progress": 0.42,
    "result": None,
    "problem": None,
}
PROBLEM: JsonObject = {
    "type": "urn:grabberd:problem:capture-running",
    "title": "capture running",
    "status": 409,
    "detail": f"capture {_ID} is running",
    "hint": f"stop it first: POST /api/v1/captures/{_ID}/stop",
}

_GROUP: JsonObject = {
    "id": "20260301T093000125Z",
    "devices": ["left", "right"],
    "start_utc": "2026-03-01T09:30:00.125Z",
    "start_ns": 81_302_117_400_512,
}
GROUP: JsonObject = {
    **_GROUP,
    "captures": [
        {
            **CAPTURE,
            "id": f"{_GROUP['id']}-{device}",
            "device": device,
            "group": _GROUP,
            "first_field_s": 0.0134,
        }
        for device in _GROUP["devices"]
    ],
}
