"""Writes the parts of docs/reference that the program knows itself: `make docs`; a test compares them."""

import json
import runpy
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from grabberd.api import create_app
from grabberd.config import Config, default_config_file, load_config
from grabberd.documents.profiles import CowProfile, CupProfile, LinerProfile, PulsatorProfile
from grabberd.documents.requests import CertifiedLength
from grabberd.processes.analysis.columns import TABLES
from grabberd.processes.columns import LABELS, WORD, Column, TableSpec
from grabberd.processes.study.columns import TABLES as STUDY_TABLES
from grabberd.processes.study.columns import captures_spec
from grabberd.reconstruction.object_model import KEYS, TARGET_KEYS, FileKey
from grabberd.schemas import SCHEMAS, schema_of
from grabberd.service.calibrations.calibration_frames import CALIBRATION_FRAME_KEYS
from grabberd.service.service import Service
from grabberd.service.setup import set_up
from grabberd.storage.export.channel_columns import CHANNEL_COLUMNS
from grabberd.storage.export.ply_file import PLY_NAMES, PLY_TYPES
from grabberd.storage.export.points_columns import (
    CLOUD_COLUMNS,
    DATASET_COLUMNS,
    GRID_ARRAYS,
    GRID_COLUMNS,
    POINT_COLUMNS,
)

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
POINTS_BEFORE = """\
The points of one run of a capture, as written by `grabberd export --format csv|ply|parquet|mat|c3d`, or
downloaded from `/api/v1/captures/{capture_id}/points.csv`, `.ply`, `.parquet`, `.mat` and `.c3d`, with
`?run=`. In the first three, a row is one target in one field:
"""
POINTS_AFTER = """
**CSV** has every column. Coordinates have all their digits, so they read back bit for bit. In all CSV files,
a text that begins with `=`, `+`, `-`, `@`, a tab or a carriage return is prefixed with an apostrophe, because
spreadsheet programs would run it as a formula; numbers are unchanged.

**PLY** is binary, little-endian, a point cloud for MeshLab, CloudCompare, Open3D and the like: all fields in
one cloud, distinguished by the property `n`, or a single field with `?field=` (`--field`). It contains
neither the time of day nor image coordinates.

**Captures recorded as a group share one time axis**: `time_s` plus the capture's `first_field_s` (in its
document; from the file, `time_ns` of its first field minus `start_ns`) is the time in seconds since the
common start; so is, to a millisecond, `time_utc` minus the group's `start_utc` ([several
grabbers](../howto/several.md)).

**Parquet** has every column, each with the metadata `unit` and `description`. The file's own metadata
`grabberd` are a JSON document: capture, run, calibration, version, verdict, and site, labels and note as
recorded. Writing it requires pyarrow: `pip install 'grabberd[parquet]'`; without it the API answers 501. The
daemon leaves the work to a niced child process. In Python:
`pyarrow.parquet.read_table(file)`, `pandas.read_parquet(file)`.

**HDF5**, `points.h5`, has the groups `points` and, if the capture has channels, `channels`: an array for each
column of `points.csv` and `channels.csv`, with the attributes `unit` and `meaning`; times of day are strings.
The file's attribute `grabberd` is the same document as in Parquet. Writing it requires h5py: `pip install
'grabberd[hdf5]'`. It is not available over HTTP.
"""
MAT = """
## MAT

`points.mat` (version 5) opens in MATLAB and Octave without a toolbox, in Python with `scipy.io.loadmat`, in
Julia and R. Arrays are F fields by T targets, including lost fields and targets that were not found; NaN
where there is no point:

| array | size | unit | |
|---|---|---|---|"""
MAT_SIZES = {"n": "F × 1", "time_s": "F × 1", "nominal_mm": "T × 3", "residual_px": "F × T"}
MAT_AFTER = """
If the capture has channels, `channels` has a row for each, in cell arrays: `name`, `quantity`, `logger`,
`unit`, and all of its readings, `time_s` (since the first field, as `points.time_s`), `sigma_time_s`,
`value`, `vacuum_kpa` (empty for a light), with the σ common to them, `sigma_vacuum_kpa` and `sigma_delay_s`.

The structs `units` and `meanings` contain the last two columns of this table, e.g. `units.points.xyz_mm`.
`ledger` has the columns of `ledger.csv`; `about` has the capture's id, creation time, run, calibration,
version, verdict, site, labels, note, rate and the time of day of the first field. Labels are a cell array of
names and values. All numbers are doubles, because MATLAB would do integer arithmetic with integers; only σ,
residuals and image coordinates are single, the precision stored in a capture.

    S = load('points.mat');  p = S.points;
    plot(p.time_s, p.xyz_mm(:, p.target == 27, 3))              % Z of a target
    squeeze(p.xyz_mm(51, :, :))                                 % all targets in field 50
    imagesc(p.n, p.target, isnan(p.xyz_mm(:, :, 1))')           % what was not found
    plot(S.channels.time_s{1}, S.channels.vacuum_kpa{1})        % the first channel

Not included are the time of day of each field (`about.first_field_utc` plus `time_s`) and correlations
between the axes. MATLAB reads variables of this version up to 2 GB, an hour and a half at 108 targets; larger
files are refused, with their size. Writing needs one and a half times as much memory. Downloads of more than
600 MB, half an hour, are refused as well, since the process that makes them shares the daemon's memory.

## C3D

`points.c3d` is for motion analysis programs. Each target is a marker, named after its id, row and column on
the target grid: `T027_R04_C02`. Each field, including lost ones, is a frame, so that frame k is field
k − 1 + `GRABBERD:FIRST_N`, (k − 1) / `POINT:RATE` seconds after the first. A marker that was not found has
the residual −1. Units are mm; the axes are those of the object's frame, `X_SCREEN` and `Y_SCREEN` those in
which the left view shows it. The group `GRABBERD` has the capture's id, creation time, run, calibration and
verdict.

The **residual** is the σ of the position from pointing and line jitter, √(σx² + σy² + σz²), in steps of
`POINT:SCALE`, 255 at most and never 0, which would mean that the point was interpolated. As the standard
requires, the fourth word of a point is the number 256 · cameras + residual in single precision, and py-c3d
reads it so. ezc3d swaps the two: its residuals are the cameras, three times the scale.

**Channels** are analog channels, in kPa. C3D supports them only at an integer multiple of the frame rate: the
multiple nearest to the rate of the fastest channel is used, at most 40; four samples per field are 200 a
second. A sample is the mean of the readings within half a step of its time, by the true times of fields and
readings; the first sample of each frame is at the field's own time. Nothing is filled in: a step without a
reading is NaN. The original readings, with their times and σ, are in the other formats.

Not included are digits of X, Y, Z beyond single precision (.00001 mm), the σ of each axis and of the
calibration, image coordinates, the true times of fields (they follow the nominal rate within the clock's
drift), and the reasons for losses (see `ledger.csv` beside it). More than 65 535 frames are counted in
`POINT:LONG_FRAMES` and `TRIAL:ACTUAL_END_FIELD` (ezc3d reads on to the end of the last block instead), more
than 255 markers are named in `POINT:LABELS2` and so on; more than 16 777 216 frames, or about 3000 markers,
are refused.
"""
DATASETS = """
## Data sets

The files of a [data set](../howto/archive.md) are Parquet as well. They have all columns above, and these:

| column | Parquet | |
|---|---|---|"""
CHANNELS_BEFORE = """
## Channels

Quantities measured beside the picture, such as the vacuum or a light: `channels.csv` or `channels.parquet`
beside the points of a capture with channels, or `/api/v1/captures/{capture_id}/channels.csv`. A row is one
reading of one channel. Readings begin up to a quarter of a second before the first field and end up to a
quarter of a second after the last. The metadata `grabberd` of the Parquet file contain the capture and each
channel's calibration.

| column | unit | Parquet | |
|---|---|---|---|"""
ANALYSIS_BEFORE = """\
The tables written by `grabberd analyse`, or served at
`/api/v1/captures/{capture_id}/analyses/{number}/TABLE.csv`. For how to make them and what the inputs mean see
[analyse](../howto/analyse.md).

Every measured column (marked ±) is followed by `sigma_NAME`, its σ in the same unit. σ includes the
contributions of the points, the vacuum, the clocks and the material, as far as their σ were given, but not
the error of the calibration, which is the same in all fields. An unknown value is empty in CSV and NaN in
Parquet, HDF5, MAT, VTU and PLY; nothing is filled in. An integer column is float64 if a value is unknown.
Coordinates are in the object's frame.

**CSV**: one file per table, seven digits. **Parquet** (`pip install 'grabberd[parquet]'`): the same with all
digits; columns have the metadata `unit` and `description`, and the file's metadata `grabberd` say what it was
made from. **HDF5** (`pip install 'grabberd[hdf5]'`): `analysis.h5` with a group per table and an array per
column, with the attributes `unit` and `meaning`, and a group `grid` with the targets' ids, rows, columns,
nominal positions and triangles. It opens in MATLAB, Python, Julia and R. **MAT**: `analysis.mat` (version 5)
opens in MATLAB and Octave without a toolbox: a struct per table, whose columns can be passed to
`struct2table` (all numbers are doubles), `grid`, whose triangles count from 1 for `trisurf`, and `units`,
`meanings` and `about`, e.g. `units.fields.mean_contact_kpa`. A table of more than 2 GB is refused.

**VTU** and **PLY**: a mesh for each field and phase. Its vertices are the targets on the smooth outer face,
in mm, with every numeric column of `targets` or `phase_targets`; a target without a position is left out.
`vtu/fields.pvd` and `vtu/phases.pvd` are the same as time series, for ParaView.

The **report** is `report.html` to read and `report.json` for programs: inputs, problems, the grid, and all
tables column by column, except those of targets, triangles and edges; the targets are included for four
states."""
STUDY_BEFORE = """\
The tables written by `grabberd study`. For how to make and read them see [study](../howto/study.md).

Every measured column (marked ±) is followed by `sigma_NAME`, its σ in the same unit, and by
`sigma_common_NAME`, the part of it that the captures of a liner share. An unknown value is empty in CSV and
NaN in Parquet; nothing is filled in. **CSV**: one file per table, seven digits. **Parquet**
(`pip install 'grabberd[parquet]'`): the same with all digits; columns have the metadata `unit` and
`description`, and the file's metadata `grabberd` say what it was made from.

The **report** is `report.html` to read and `study.json` for programs: the question, all values and results
for each quantity, what was left out, and all tables column by column.

The table `captures` has columns for the labels and quantities of the study; shown here are those of a study
of one label and one quantity."""
PROFILES_BEFORE = """\
The keys of each kind of profile. For how to use profiles see [profiles](../howto/profiles.md). Unknown keys
are refused. `material`, `pulsation`, `liner`, `flow_stop` and `analysis` have the same keys as in the
[inputs of an analysis](../howto/analyse.md#inputs) ([material](../howto/pressure.md#what-is-computed)).
"""
SCHEMAS_BEFORE = """\
JSON Schemas (draft 2020-12) of the files that people or programs write: for editors, which complete keys and
mark mistakes as you type, and for programs that write such files.
"""
SCHEMAS_AFTER = """
## In an editor

    grabberd schema configuration > configuration.schema.json

Then, for VS Code (with its YAML extension), Neovim, Emacs and other editors that use the YAML language
server, begin the file with the line

    # yaml-language-server: $schema=configuration.schema.json

In JetBrains editors: Settings, JSON Schema Mappings. A calibration is JSON; map `*.calibration.json` to
`calibration.schema.json`.

## What a schema cannot check

A schema describes the form of a file only. Mistakes that involve several values, or other files, are found by
the program: two targets with the same id, an invalid covariance, overlapping views, a missing file. `grabberd
check-config`, `grabberd frame` and `grabberd profile add` report all of these. YAML has native dates and
times; a schema treats `2026-05-01` as text.

Unknown keys are refused both by the schema and by the program. In the configuration and in profiles a schema
is stricter about types: the program also accepts `"8050"` for a port.
"""
MADE = "<!-- made by `make docs`; do not edit -->\n"


def documents() -> dict[str, str]:
    """Every generated file's name and content."""
    description = _openapi()
    return {
        "openapi.json": _json(description),
        "http.md": "\n".join(_http(description)) + "\n",
        "configuration.md": "\n".join(_configuration()) + "\n",
        "points.md": "\n".join(_points()) + "\n",
        "analysis.md": "\n".join(_analysis()) + "\n",
        "profiles.md": "\n".join(_profiles()) + "\n",
        "study.md": "\n".join(_study()) + "\n",
        "object-files.md": "\n".join(_object_files()) + "\n",
        "commands.md": runpy.run_path(str(HERE / "commands.py"))["page"](),
        "schemas.md": "\n".join(_schemas()) + "\n",
        **{f"schemas/{name}.schema.json": _json(schema_of(name)) for name in SCHEMAS},
    }


def _json(document: dict[str, Any]) -> str:
    return json.dumps(document, indent=1, ensure_ascii=False) + "\n"


def _schemas() -> Iterator[str]:
    yield f"{MADE}# JSON Schemas of files\n"
    yield SCHEMAS_BEFORE
    yield "| `grabberd schema …` | | file |\n|---|---|---|"
    for name, form in SCHEMAS.items():
        yield f"| `{name}` | {form.title} | [{name}.schema.json](schemas/{name}.schema.json) |"
    yield SCHEMAS_AFTER.rstrip("\n")


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
    yield f"{MADE}# Profiles, key by key\n"
    yield PROFILES_BEFORE
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


def _object_files() -> Iterator[str]:
    tables = {
        "KEYS": _file_keys(KEYS),
        "TARGET_KEYS": _file_keys(TARGET_KEYS),
        "CALIBRATION_FRAME_KEYS": _file_keys(CALIBRATION_FRAME_KEYS),
        "CHECK_LENGTH": _section(CertifiedLength, "check_length"),
    }
    yield MADE.rstrip("\n")
    for line in (HERE / "object-files.template").read_text(encoding="utf-8").splitlines():
        yield from tables.get(line, [line])


def _file_keys(keys: Mapping[str, FileKey]) -> Iterator[str]:
    yield "| key | unit | value | default | |\n|---|---|---|---|---|"
    for name, key in keys.items():
        default = "required" if key.default is None else key.default
        yield f"| `{name}` | {key.unit or '–'} | {key.kind} | {default} | {key.meaning} |"


def _points() -> Iterator[str]:
    yield f"{MADE}# Points, column by column\n"
    yield POINTS_BEFORE
    yield "| column | unit | Parquet | PLY | |\n|---|---|---|---|---|"
    for one in POINT_COLUMNS:
        ply = f"`{PLY_NAMES.get(one.name, one.name)}` {PLY_TYPES[one.dtype]}" if one in CLOUD_COLUMNS else "–"
        yield f"| `{one.name}` | {one.unit or '–'} | {TYPES[one.dtype]} | {ply} | {one.meaning} |"
    yield POINTS_AFTER.rstrip("\n")
    yield MAT
    for one in GRID_COLUMNS:
        yield f"| `points.{one.name}` | {_mat_size(one)} | {one.unit or '–'} | {one.meaning} |"
    yield MAT_AFTER.rstrip("\n")
    yield DATASETS
    for one in DATASET_COLUMNS[len(POINT_COLUMNS) :]:
        yield f"| `{one.name}` | {TYPES[one.dtype]} | {one.meaning} |"
    yield CHANNELS_BEFORE
    for one in CHANNEL_COLUMNS:
        yield f"| `{one.name}` | {one.unit or '–'} | {TYPES[one.dtype]} | {one.meaning} |"


def _mat_size(one: Column) -> str:
    sides = GRID_ARRAYS.get(one.name)
    return MAT_SIZES.get(one.name) or (f"F × T × {len(sides)}" if sides else "1 × T")


def _analysis() -> Iterator[str]:
    yield f"{MADE}# Tables of an analysis, column by column\n"
    yield ANALYSIS_BEFORE
    for name, table in TABLES.items():
        yield from _analysis_table(name, table)


def _study() -> Iterator[str]:
    yield f"{MADE}# Tables of a study, column by column\n"
    yield STUDY_BEFORE
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
