"""What the documents say is what the program does."""

import re
import runpy
from pathlib import Path

import pytest
import yaml

from grabberd.archive.calibrations.calibration_catalog import calibration_frame_model
from grabberd.core.reconstruction import ObjectModel
from grabberd.documents.requests import CertifiedLength
from grabberd.errors import InputError

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def generated() -> dict[str, str]:
    """Every generated document by its name."""
    return runpy.run_path(str(ROOT / "docs" / "reference" / "generate.py"))["documents"]()


def test_generated_documents_are_up_to_date(generated: dict[str, str]) -> None:
    folder = ROOT / "docs" / "reference"
    outdated = [name for name, text in generated.items() if (folder / name).read_text() != text]
    assert not outdated, "run `make docs`"


def test_every_link_between_documents_leads_somewhere() -> None:
    for document in [*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md")]:
        for link in re.findall(r"\]\(([^)#]+)\)", document.read_text()):
            if not link.startswith("http"):
                assert (document.parent / link).exists(), f"{document.name}: {link}"


def examples_of_object_files(page: str) -> list[dict]:
    """The YAML documents among the indented blocks of the page, without its commands."""
    blocks = re.findall(r"(?:^    .*\n)+", page, re.MULTILINE)
    return [yaml.safe_load(block) for block in blocks if block.startswith("    name:")]


def test_the_examples_of_object_files_are_read(generated):
    an_object, stand = examples_of_object_files(generated["object-files.md"])
    plate = ObjectModel.from_document(an_object)
    assert plate.target_sigma_mm.tolist() == [0.3, 0.3, 0.3, 1.0]
    model = calibration_frame_model(stand)
    length = CertifiedLength.model_validate(stand["check_length"])
    first, last = (model.xyz_mm[model.target == one][0] for one in length.between)
    assert abs(((last - first) ** 2).sum() ** 0.5 - length.length_mm) < 0.002


def test_the_page_of_object_files_names_every_key_that_is_read(generated):
    page = generated["object-files.md"]
    for refused in ({"unknown": 1}, {"targets": [{"unknown": 1}]}):
        with pytest.raises(InputError) as caught:
            ObjectModel.from_document(refused)
        known = caught.value.message.partition("unknown: unknown key; known keys are ")[2].partition(";")[0]
        for key in known.split(" (")[0].split(", "):
            assert f"| `{key}` |" in page
