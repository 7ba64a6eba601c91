"""A study of some captures of the archive, by a process of its own."""

import pytest

from grabberd.errors import InputError
from grabberd.work.process import Processes
from grabberd_liner.studies.routes import StudyDocument, study_in_process, study_of
from liner.studies.test_studies import Barn, barn

__all__ = ["barn"]


def quantities(*values: float) -> list[list[dict[str, object]]]:
    one = {"name": "overpressure_map_kpa", "unit": "kPa", "sigma": 0.1, "sigma_common": 0.0}
    return [[{**one, "value": value}] for value in values]


def test_groups_that_differ_are_told_by_the_test_of_the_study(barn: Barn, processes: Processes) -> None:
    for name, found in zip(("a1", "a2", "b1"), quantities(9.5, 9.6, 12.0), strict=True):
        barn.analyse(name, quantities=found)
    document = study_in_process(processes, barn.folder, ["a1", "a2", "b1"], "liner", None)
    study = StudyDocument.model_validate(document)
    (one,) = study.quantities
    assert (one.groups, one.values.capture) == (["A", "B"], ["a1", "a2", "b1"])
    assert one.differences[0].value == pytest.approx(12.0 - 9.55)
    assert one.verdict == "differ"
    assert document == study_of(barn.folder, ["a1", "a2", "b1"], "liner", None) | {
        "created_utc": document["created_utc"]
    }


def test_who_takes_no_part_is_listed_with_the_reason(barn: Barn) -> None:
    barn.analyse("a1")
    document = study_of(barn.folder, ["a1", "b1", "gone"], None, None)
    reasons = {one["capture"]: one["reason"] for one in document["left_out"]}
    assert reasons == {"b1": "it has not been analysed", "gone": "there is no such capture"}
    assert document["captures"] == 1


def test_none_at_all_is_refused(barn: Barn) -> None:
    with pytest.raises(InputError, match="no capture"):
        study_of(barn.folder, ["gone"], None, None)
