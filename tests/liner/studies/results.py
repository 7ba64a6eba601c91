"""Results of analyses, made up, in folders as `grabberd analyse --out` leaves them."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

COMPRESSION, OVERPRESSURE = "liner_compression_mean_kpa", "overpressure_map_kpa"
_COLUMNS = (
    "name",
    "title",
    "value",
    "sigma_value",
    "sigma_common",
    "unit",
    "verdict",
    "reason",
    "definition",
)
LABELS = {"liner": "A", "cow": "112"}


def quantity(
    name: str, value: float | None, sigma: float = 0.5, common: float = 0.3, reason: str = ""
) -> Any:
    known = (None, None) if value is None else (sigma, common)
    return dict(
        zip(_COLUMNS, (name, f"title of {name}", value, *known, "kPa", "", reason, "what it is"), strict=True)
    )


def table(rows: list[dict[str, Any]], columns: tuple[str, ...] = _COLUMNS) -> dict[str, Any]:
    return {
        "meaning": "quantities",
        "columns": [
            {"name": name, "unit": "", "meaning": "", "values": [row[name] for row in rows]}
            for name in columns
        ],
    }


def report(
    capture_id: str,
    value: float | None = 40.0,
    *,
    labels: Mapping[str, str] = LABELS,
    created_utc: str = "2026-11-20T08:00:00.000Z",
    **changes: Any,
) -> dict[str, Any]:
    rows = [
        quantity(COMPRESSION, value, reason="" if value else "nothing presses"),
        quantity(OVERPRESSURE, None, reason="flow_stop was not given"),
    ]
    return {
        "schema": "grabberd/analysis-report/1",
        "id": capture_id,
        "created_utc": created_utc,
        "pressure_method": "equilibrium",
        "about": {
            "captured_utc": "2026-11-05T06:00:00.000Z",
            "device": "barn",
            "labels": dict(labels),
            "ledger": {"total": 8, "received": 8, "lacking": []},
            "profiles": [],
        },
        "inputs": {"given": {}},
        "tables": {"quantities": table(rows), "fields": {"columns": []}},
        **changes,
    }


def store(folder: Path, document: Any) -> Path:
    folder.mkdir(parents=True)
    (folder / "report.json").write_text(json.dumps(document), "utf-8")
    return folder
