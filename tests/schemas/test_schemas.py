"""A schema and the reader of its files say the same, but for what only the reader can know."""

import json
import re
from collections.abc import Callable
from dataclasses import asdict
from functools import cache
from pathlib import Path
from typing import Any

import jsonschema_rs
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import TypeAdapter, ValidationError
from typer.testing import CliRunner

import grabberd
from grabberd.archive.calibrations.calibration_catalog import calibration_frame_model
from grabberd.cli.app import app
from grabberd.config import load_config
from grabberd.core.geometry import Calibration, Reading
from grabberd.core.reconstruction import ObjectModel
from grabberd.documents.requests import CertifiedLength
from grabberd.errors import ConfigError, GrabberdError, InputError, NotFound
from grabberd.schemas import known_forms, schema_of
from grabberd_liner.analysis.wall.material import read_parts
from grabberd_liner.chain.analysis.inputs import input_problems, is_channel
from grabberd_liner.chain.analysis.vacuum_inputs import read_constant, read_lag, read_offset, read_wave
from grabberd_liner.profiles.documents import ProfileContent
from schemas.generated import changed, drawn_from

ROOT = Path(__file__).parents[2]
CONFIGS = ROOT / "configs"
FILES = {
    "configuration": "*.yaml",
    "object": "objects/*.yaml",
    "calibration-frame": "calibration-frames/*.yaml",
    "calibration": "*.calibration.json",
    "analysis-inputs": "analysis/*.yaml",
    "profile": "profiles/*.yaml",
}
SHIPPED = [
    pytest.param(name, path, id=path.name)
    for name, files in FILES.items()
    for path in sorted(CONFIGS.glob(files))
]


@cache
def validator(name: str) -> Any:
    return jsonschema_rs.validator_for(schema_of(name))


def allowed(name: str, document: object) -> bool:
    return bool(validator(name).is_valid(document))


@cache
def read(path: Path) -> Any:
    """A file's document, with dates as texts, as an editor sees them."""
    text = path.read_text()
    if path.suffix == ".json":
        return json.loads(text)
    return json.loads(json.dumps(yaml.safe_load(text), default=str))


@pytest.mark.parametrize("name", known_forms())
def test_a_schema_is_one(name: str) -> None:
    jsonschema_rs.meta.validate(schema_of(name))


@pytest.mark.parametrize(("name", "path"), SHIPPED)
def test_every_file_that_comes_with_the_program_has_the_form_of_its_schema(name: str, path: Path) -> None:
    problems = [
        f"{'.'.join(map(str, one.instance_path))}: {one.message}"
        for one in validator(name).iter_errors(read(path))
    ]
    assert problems == []


def test_a_capture_file_has_the_form_of_its_schema() -> None:
    for path in (ROOT / "src/grabberd/examples").glob("*.grab"):
        with grabberd.open(path) as capture:
            document = json.loads(json.dumps(asdict(capture.meta)))
        validator("capture-meta").validate(document)
        assert not allowed("capture-meta", document | {"bits": 7})
        assert not allowed("capture-meta", document | {"start_ns": -1})
        assert allowed("capture-meta", document | {"of_a_later_version": 1})


@pytest.mark.parametrize(
    ("change", "key"),
    [
        ({"http": {"port": 70_000}}, "http.port"),
        ({"htp": {}}, "htp"),
        ({"devices": {}}, "devices"),
        ({"devices": {"cup": {"driver": "fake", "ring": {"bits": 7}}}}, "devices.cup.ring.bits"),
        ({"devices": {"Cup 1": {"driver": "fake"}}}, "devices.Cup 1"),
        ({"devices": {"cup": {}}}, "devices.cup.driver"),
        ({"loggers": {"vacuum": {"driver": "fake", "channels": {}}}}, "loggers.vacuum.channels"),
    ],
)
def test_a_configuration_that_is_refused_for_its_form_is_refused_by_the_schema(
    change: dict[str, Any], key: str, tmp_path: Path
) -> None:
    document = {"devices": {"cup": {"driver": "fake"}}} | change
    (tmp_path / "grabberd.yaml").write_text(yaml.safe_dump(document))
    with pytest.raises(ConfigError, match=re.escape(key)):
        load_config(tmp_path / "grabberd.yaml")
    assert not allowed("configuration", document)


@pytest.mark.parametrize(
    "change",
    [
        {"name": 112},
        {"name": "a/b"},
        {"kind": "horse"},
        {"age_milkings": -1},
        {"no_such_key": 1},
        {"lag": {"opening_s": 0.1}},
    ],
)
def test_a_profile_that_is_refused_for_its_form_is_refused_by_the_schema(change: dict[str, Any]) -> None:
    document = read(CONFIGS / "profiles/liner-example-reference.yaml") | change
    with pytest.raises(ValidationError):
        TypeAdapter(ProfileContent).validate_python(document)
    assert not allowed("profile", document)


def test_a_liners_material_is_part_of_the_schema_of_its_profile() -> None:
    document = read(CONFIGS / "profiles/liner-example-reference.yaml")
    assert not allowed("profile", document | {"material": document["material"] | {"wall": 2.5}})


def read_inputs(document: dict[str, Any]) -> None:
    """All that is read of the inputs of an analysis before there is a capture."""
    if problems := input_problems(document):
        raise InputError("; ".join(problems), "")
    if "material" in document:
        read_parts(document["material"])
    vacuum = document.get("vacuum") or {}
    for chamber in ("pulsation", "liner"):
        read_chamber(chamber, vacuum.get(chamber, "log"))
    if vacuum.get("offset") != "light":
        read_offset(vacuum)
    if "lag" in vacuum:
        read_lag(vacuum)
    reading = Reading("vacuum")
    if "gauge_sigma_kpa" in vacuum:
        reading.number(vacuum, "gauge_sigma_kpa", positive=True)
    if "log" in vacuum:
        reading.text(vacuum, "log")
    reading.finish("")


def read_chamber(chamber: str, value: Any) -> None:
    if not isinstance(value, dict):
        if value not in ("log", "channel"):
            raise InputError(f"vacuum.{chamber} is {value!r}", "")
    elif is_channel(value):
        reading = Reading(f"vacuum.{chamber}")
        reading.text(value, "channel")
        reading.finish("")
    elif chamber == "pulsation" and "rate_per_min" in value:
        read_wave(value)
    else:
        read_constant(chamber, value)


def read_frame(document: dict[str, Any]) -> None:
    calibration_frame_model(document)
    if "check_length" in document:
        try:
            CertifiedLength.model_validate(document["check_length"])
        except ValidationError as error:
            raise InputError(str(error), "") from error


READERS: dict[str, tuple[Callable[[dict[str, Any]], object], Path]] = {
    "object": (ObjectModel.from_document, CONFIGS / "objects/liner.yaml"),
    "calibration-frame": (read_frame, CONFIGS / "calibration-frames/paper-108.yaml"),
    "calibration": (Calibration.from_document, CONFIGS / "fake.calibration.json"),
    "analysis-inputs": (read_inputs, CONFIGS / "analysis/liner.yaml"),
}
ONLY_THE_READER_KNOWS = {
    "object": ("is given twice", "three numbers that are not all 0"),
    "calibration-frame": ("is given twice", "three numbers that are not all 0"),
    "calibration": (
        "ISO 8601",
        "do not lie inside the picture",
        "they overlap or are swapped",
        "is not symmetric",
        "has a negative eigenvalue",
        r"_px: is .*, expected \d+ x \d+ finite numbers",  # grids of one local field differ in size
    ),
    "analysis-inputs": (
        "needs vacuum.log",
        "poisson: is missing",  # of a law that leaves it open
        r"agreement\.table",
        r"agreement\.above",
        "offset and lag are both given",
        "a direction, not all zeros",
        "first and last row",
        "thicker than a liner",
        "keeps the volume",
        "expected below last_end_mm",
        "which no three values can have",
        "leave no room for b and d",
    ),
}
"""Reasons, by their words, for which a document of the right form may be refused."""
ONE_IS_WHOLE = re.compile(r": is -?\d+\.0, expected a whole number")
"""YAML and Python tell 1.0 from 1, JSON Schema does not."""


def refusal(name: str, document: Any) -> str:
    """The reader's reason for refusing a document, or nothing."""
    try:
        READERS[name][0](document)
    except GrabberdError as error:
        return error.message
    return ""


def small(name: str) -> dict[str, Any]:
    """A shipped document with four targets, and without a large covariance."""
    document = dict(read(READERS[name][1]))
    if "targets" in document:
        document["targets"] = document["targets"][:4]
    if name == "calibration":
        document["covariance"] = None
    return document


@pytest.mark.parametrize("name", READERS)
@given(data=st.data())
@settings(max_examples=150)
def test_what_the_schema_allows_is_read_or_refused_for_a_reason_that_no_form_has(
    name: str, data: st.DataObject
) -> None:
    schema = schema_of(name)
    if name == "calibration":  # 1296 numbers would be all that is drawn
        schema["properties"]["covariance"] = {"type": "null"}
    document = data.draw(drawn_from(schema))
    assert allowed(name, document)
    reason = refusal(name, document)
    known = any(re.search(words, reason) for words in ONLY_THE_READER_KNOWS[name])
    assert not reason or known, f"{reason}: {document}"


@pytest.mark.parametrize("name", READERS)
def test_what_is_changed_was_read_before(name: str) -> None:
    assert allowed(name, small(name))
    assert not refusal(name, small(name))


@pytest.mark.parametrize("name", READERS)
@given(data=st.data())
@settings(max_examples=300)
def test_what_has_been_changed_is_judged_alike_by_schema_and_reader(name: str, data: st.DataObject) -> None:
    document = data.draw(changed(small(name)))
    reason = refusal(name, document)
    if allowed(name, document):
        known = any(re.search(words, reason) for words in ONLY_THE_READER_KNOWS[name])
        assert not reason or known or ONE_IS_WHOLE.search(reason), f"{reason}: {document}"
    else:
        problems = [one.message for one in validator(name).iter_errors(document)]
        assert reason, f"the reader takes it, the schema says {problems}: {document}"


def run(*words: str) -> str:
    result = CliRunner().invoke(app, ["schema", *words])
    if isinstance(result.exception, GrabberdError):
        raise result.exception
    assert result.exit_code == 0, result.output
    return result.stdout


def test_the_command_prints_a_schema() -> None:
    assert json.loads(run("object")) == schema_of("object")


def test_the_command_lists_the_schemas() -> None:
    assert [line.split()[0] for line in run().splitlines()] == list(known_forms())


def test_a_schema_that_there_is_not_is_answered_with_those_that_there_are() -> None:
    with pytest.raises(NotFound, match="no schema 'cow'") as caught:
        run("cow")
    assert "profile" in caught.value.hint
