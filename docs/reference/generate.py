"""Writes the parts of docs/reference that the program knows itself: `make docs`; a test compares them."""

import json
import runpy
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from grabberd.archive.calibrations.calibration_catalog import CALIBRATION_FRAME_KEYS
from grabberd.archive.export.channels_export import CHANNEL_COLUMNS
from grabberd.archive.export.points_columns import (
    CLOUD_COLUMNS,
    DATASET_COLUMNS,
    GRID_ARRAYS,
    GRID_COLUMNS,
    POINT_COLUMNS,
)
from grabberd.archive.export.table_files import PLY_NAMES, PLY_TYPES
from grabberd.config import Config, default_config_file, load_config
from grabberd.core.chain.columns import LABELS, WORD, Column, TableSpec
from grabberd.core.reconstruction.object_model import KEYS, TARGET_KEYS, FileKey
from grabberd.documents.requests import CertifiedLength
from grabberd.instrument.setup import set_up
from grabberd.schemas import known_forms, schema_of
from grabberd.server.api import create_app
from grabberd.server.daemon.service import Service
from grabberd_liner.chain.analysis.columns import TABLES
from grabberd_liner.chain.study.study_document import TABLES as STUDY_TABLES
from grabberd_liner.chain.study.study_document import captures_spec
from grabberd_liner.profiles.documents import CowProfile, CupProfile, LinerProfile, PulsatorProfile

HERE = Path(__file__).parent
TYPES = {
    "i4": "int32",
    "i8": "int64",
    "f4": "float32",
    "f8": "float64",
    "U": "string",
    "M8[ms]": "timestamp, ms, UTC",
    WORD: "dictionary of strings",
    LABELS: "map of strings to strings",
}
MAT_SIZES = {"n": "F × 1", "time_s": "F × 1", "nominal_mm": "T × 3", "residual_px": "F × T"}
MADE = "<!-- made by `make docs`; do not edit -->\n"


def documents() -> dict[str, str]:
    """Every generated file's name and content."""
    description = _openapi()
    return {
        "openapi.json": _json(description),
        "http.md": "\n".join(_http(description)) + "\n",
        "configuration.md": "\n".join(_configuration()) + "\n",
        "points.md": _filled(
            "points",
            POINT_COLUMNS=_point_columns(),
            GRID_COLUMNS=_grid_columns(),
            DATASET_COLUMNS=_dataset_columns(),
            CHANNEL_COLUMNS=_channel_columns(),
        ),
        "analysis.md": _filled("analysis", TABLES=_analysis()),
        "profiles.md": _filled("profiles", PROFILES=_profiles()),
        "study.md": _filled("study", TABLES=_study()),
        "object-files.md": _filled(
            "object-files",
            KEYS=_file_keys(KEYS),
            TARGET_KEYS=_file_keys(TARGET_KEYS),
            CALIBRATION_FRAME_KEYS=_file_keys(CALIBRATION_FRAME_KEYS),
            CHECK_LENGTH=_section(CertifiedLength, "check_length"),
        ),
        "commands.md": runpy.run_path(str(HERE / "commands.py"))["page"](),
        "schemas.md": _filled("schemas", SCHEMAS=_schemas()),
        **{f"schemas/{name}.schema.json": _json(schema_of(name)) for name in known_forms()},
    }


def _json(document: dict[str, Any]) -> str:
    return json.dumps(document, indent=1, ensure_ascii=False) + "\n"


def _schemas() -> Iterator[str]:
    yield "| `grabberd schema …` | | file |\n|---|---|---|"
    for name, form in known_forms().items():
        yield f"| `{name}` | {form.title} | [{name}.schema.json](schemas/{name}.schema.json) |"


def _openapi() -> dict[str, Any]:
    file = default_config_file()
    service = Service(set_up(load_config(file), file), Path("nowhere"))
    return create_app(service).openapi()


def _http(description: dict[str, Any]) -> Iterator[str]:
    yield f"{MADE}# HTTP API\n"
    yield "Errors are problem documents (RFC 9457) with a `hint` that says what to do. Times are UTC."
    yield "The complete OpenAPI description: [openapi.json](openapi.json), or `/api/v1/openapi.json`.\n"
    yield "The role is the lowest that suffices: viewer, operator or admin.\n"
    yield "| | | role | |\n|---|---|---|---|"
    for path, methods in description["paths"].items():
        for method, operation in methods.items():
            role = operation.get("x-least-role", "–")
            words = " ".join(operation["description"].split())
            yield f"| `{method.upper()}` | `{path}` | {role} | {words} |"
    schemas = description["components"]["schemas"]
    yield "\n## Body of a request for a capture\n"
    yield from _schema(schemas["NewCapture"])
    yield "\n## Body of a request for captures of several devices\n"
    yield from _schema(schemas["NewCaptureGroup"])
    yield "\n## Body of a request for a calibration\n"
    yield from _schema(schemas["CalibrationRequest"])
    yield "\nIts `options`:\n"
    yield from _schema(schemas["CalibrationOptions"])


def _schema(schema: dict[str, Any]) -> Iterator[str]:
    yield "| key | default | |\n|---|---|---|"
    for name, field in schema["properties"].items():
        yield f"| `{name}` | {json.dumps(field.get('default'))} | {field.get('description', '')} |"


def _configuration() -> Iterator[str]:
    yield f"{MADE}# Configuration\n"
    yield "A YAML file. Relative paths are relative to its folder. Unknown keys are refused.\n"
    yield from _section(Config, "")


def _section(model: type[BaseModel], prefix: str) -> Iterator[str]:
    yield f"## {prefix or 'top'}\n\n{' '.join((model.__doc__ or '').split())}\n"
    yield "| key | default | allowed | |\n|---|---|---|---|"
    inner: list[tuple[str, type[BaseModel]]] = []
    for name, field in model.model_fields.items():
        yield f"| `{name}` | {_default(field)} | {_allowed(field)} | {field.description or ''} |"
        inner += [(f"{prefix}.{name}".strip("."), found) for found in _models(field.annotation)]
    yield ""
    for name, found in inner:
        yield from _section(found, f"{name}.NAME" if name == "devices" else name)


def _default(field: FieldInfo) -> str:
    if field.is_required():
        return "required"
    value = field.get_default(call_default_factory=True)
    return "see below" if isinstance(value, BaseModel) else f"`{json.dumps(value, default=str)}`"


def _profiles() -> Iterator[str]:
    for model in (LinerProfile, PulsatorProfile, CupProfile, CowProfile):
        yield from _section(model, model.__name__.removesuffix("Profile").lower())


def _allowed(field: FieldInfo) -> str:
    return ", ".join(_limit(limit) for limit in field.metadata if _limit(limit))


def _limit(limit: object) -> str:
    signs = {
        "ge": "≥",
        "gt": ">",
        "le": "≤",
        "lt": "<",
        "multiple_of": "a multiple of",
        "min_length": "length ≥",
    }
    found = [
        f"{sign} {getattr(limit, name)}"
        for name, sign in signs.items()
        if getattr(limit, name, None) is not None
    ]
    return " ".join(text for text in found if str(PydanticUndefined) not in text)


def _models(annotation: Any) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [model for argument in getattr(annotation, "__args__", ()) for model in _models(argument)]


def _filled(name: str, **tables: Iterable[str]) -> str:
    """The template NAME.template, with a table in place of each line that names one."""
    lines = [MADE.rstrip("\n")]
    for line in (HERE / f"{name}.template").read_text(encoding="utf-8").splitlines():
        lines += tables.get(line, [line])
    return "\n".join(lines) + "\n"


def _file_keys(keys: Mapping[str, FileKey]) -> Iterator[str]:
    yield "| key | unit | value | default | |\n|---|---|---|---|---|"
    for name, key in keys.items():
        default = "required" if key.default is None else key.default
        yield f"| `{name}` | {key.unit or '–'} | {key.kind} | {default} | {key.meaning} |"


def _point_columns() -> Iterator[str]:
    yield "| column | unit | Parquet | PLY | |\n|---|---|---|---|---|"
    for one in POINT_COLUMNS:
        ply = f"`{PLY_NAMES.get(one.name, one.name)}` {PLY_TYPES[one.dtype]}" if one in CLOUD_COLUMNS else "–"
        yield f"| `{one.name}` | {one.unit or '–'} | {TYPES[one.dtype]} | {ply} | {one.meaning} |"


def _grid_columns() -> Iterator[str]:
    for one in GRID_COLUMNS:
        yield f"| `points.{one.name}` | {_mat_size(one)} | {one.unit or '–'} | {one.meaning} |"


def _dataset_columns() -> Iterator[str]:
    for one in DATASET_COLUMNS[len(POINT_COLUMNS) :]:
        yield f"| `{one.name}` | {TYPES[one.dtype]} | {one.meaning} |"


def _channel_columns() -> Iterator[str]:
    for one in CHANNEL_COLUMNS:
        yield f"| `{one.name}` | {one.unit or '–'} | {TYPES[one.dtype]} | {one.meaning} |"


def _mat_size(one: Column) -> str:
    sides = GRID_ARRAYS.get(one.name)
    return MAT_SIZES.get(one.name) or (f"F × T × {len(sides)}" if sides else "1 × T")


def _analysis() -> Iterator[str]:
    for name, table in TABLES.items():
        yield from _analysis_table(name, table)


def _study() -> Iterator[str]:
    example = ("liner_compression_mean_kpa", "kPa", "liner compression, mean")
    yield from _analysis_table("captures", captures_spec(["cow"], [example]))
    for name, table in STUDY_TABLES.items():
        yield from _analysis_table(name, table)


def _analysis_table(name: str, table: TableSpec) -> Iterator[str]:
    yield f"\n## {name}\n\n{table.meaning}.\n"
    yield "| column | unit | type | |\n|---|---|---|---|"
    for one in (*table.key, *table.values):
        unit = f"{one.unit or '–'}{' ±' if one.measured else ''}"
        yield f"| `{one.name}` | {unit} | {TYPES[one.dtype]} | {one.meaning} |"


if __name__ == "__main__":
    for name, text in documents().items():
        (HERE / name).parent.mkdir(exist_ok=True)
        (HERE / name).write_text(text, encoding="utf-8")
