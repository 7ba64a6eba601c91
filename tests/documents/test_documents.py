"""Every document is closed and frozen, its examples are valid, and this room loads no code that runs."""

import importlib
import pkgutil
import subprocess
import sys
from collections.abc import Iterator

import pytest
from pydantic import BaseModel, ValidationError

import grabberd.documents
from grabberd.config import shipped_configs
from grabberd.core.reconstruction.coverage import finding_in_words
from grabberd.documents.calibrations import CalibrationDocument
from grabberd.documents.captures import CaptureDocument, MadeWith
from grabberd.documents.document import Document
from grabberd.documents.examples import CAPTURE
from grabberd.documents.requests import CertifiedLength, NewCapture, TargetMark

for module in pkgutil.iter_modules(grabberd.documents.__path__):
    importlib.import_module(f"grabberd.documents.{module.name}")


def documents(base: type[Document] = Document) -> Iterator[type[Document]]:
    for one in base.__subclasses__():
        yield one
        yield from documents(one)


def with_examples() -> list[type[BaseModel]]:
    return [one for one in documents() if "json_schema_extra" in one.__dict__["model_config"]]


@pytest.mark.parametrize("model", with_examples())
def test_an_example_is_one(model: type[Document]) -> None:
    extra = model.model_config["json_schema_extra"]
    assert isinstance(extra, dict)
    examples = extra["examples"]
    assert isinstance(examples, list)
    for example in examples:
        model.model_validate(example)


@pytest.mark.parametrize("model", sorted(set(documents()), key=str))
def test_every_document_is_closed_frozen_and_described(model: type[Document]) -> None:
    assert model.model_config["extra"] == "forbid"
    assert model.model_config["frozen"]
    assert (model.__doc__ or "").strip().endswith(".")


def test_no_two_documents_have_one_name() -> None:
    names = [model.__name__ for model in set(documents())]
    assert len(set(names)) == len(names)


def test_a_document_refuses_a_key_that_it_does_not_know() -> None:
    with pytest.raises(ValidationError, match="unexpected"):
        CaptureDocument.model_validate({**CAPTURE, "unexpected": 1})


def test_a_calibration_that_is_shipped_is_as_described() -> None:
    content = (shipped_configs() / "fake.calibration.json").read_bytes()
    assert CalibrationDocument.model_validate_json(content).views.keys() == {"left", "right"}


def test_json_of_an_earlier_version_passes_as_it_was_stored() -> None:
    stored = {"calibration": {"id": "old", "camera": 1}, "object": None, "settings": None}
    assert MadeWith.model_validate(stored).model_dump(mode="json") == stored


def test_a_disarmed_capture_is_the_same_but_for_its_end() -> None:
    before = CaptureDocument.model_validate({**CAPTURE, "state": "armed"})
    after = before.disarmed
    assert (after.state, after.ended_because) == ("disarmed", "stopped before it was triggered")
    assert after.id == before.id


@pytest.mark.parametrize(
    "wrong",
    [
        {"fields": 3, "duration_s": 1},
        {"armed": True, "fields": 3},
        {"post_trigger_fields": 3},
        {"armed": True, "post_trigger_fields": 3, "duration_s": 1},
        {"fields": 3, "pre_trigger_fields": 3},
    ],
)
def test_a_capture_has_one_length(wrong: dict[str, object]) -> None:
    with pytest.raises(ValidationError):
        NewCapture.model_validate(wrong)


def test_they_load_neither_the_service_nor_the_server() -> None:
    code = (
        "import grabberd.documents.mqtt, grabberd.documents.requests, grabberd.documents.problems, sys\n"
        "rooms = 'grabberd.server', 'grabberd.instrument', 'grabberd.library', 'grabberd.work'\n"
        "others = 'grabberd.archive', 'fastapi', 'starlette'\n"
        "found = {name for name in sys.modules if name.startswith((*rooms, *others))}\n"
        "assert not found, found"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)


def test_the_example_of_a_capture_says_how_well_it_was_measured_in_the_programs_words() -> None:
    capture = CaptureDocument.model_validate(CAPTURE)
    assert capture.coverage is not None
    assert capture.coverage == capture.runs[-1].coverage
    assert capture.coverage.missing_fields == capture.ledger.counts["lost"]
    for found in capture.coverage.findings:
        assert found.in_words == finding_in_words(found.code, found.values, found.miss)


def test_a_number_that_cannot_be_reckoned_with_is_refused_with_the_reason() -> None:
    for value in (1e308, -1e31, float("inf"), float("nan")):
        with pytest.raises(ValidationError, match=r"1000000000000000000000000000000|finite"):
            TargetMark(view="left", target=1, x_px=value, y_px=0.0)
        with pytest.raises(ValidationError, match="CertifiedLength"):
            CertifiedLength(between=(1, 2), length_mm=value)
