"""The latest analysis of a capture and of a device, as they are shown."""

import json
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

import pytest
from queued_jobs import jobs_in

from archive.captures import slots, write
from grabberd.archive.catalogue.archive import Archive
from grabberd.archive.catalogue.capture_list import captures_csv
from grabberd.documents.document import JobProblem
from grabberd.documents.enums import JobState
from grabberd_liner.analyses.capture_analyses import CaptureAnalyses
from grabberd_liner.analyses.documents import CaptureAnalysis
from grabberd_liner.analyses.job import AnalysisJob
from grabberd_liner.analyses.store import AnalysisStore

PROBLEM = JobProblem(message="the wall does not pulsate", hint="start the pulsator")
QUANTITIES = [
    {
        "name": "teat_end_beyond_flow_stop_kpa",
        "unit": "kPa",
        "value": None,
        "sigma": None,
        "reason": "flow_stop was not given",
    },
    {"name": "rate_per_min", "unit": "1/min", "value": 60.2, "sigma": 0.1, "sigma_common": 0.0},
    {"name": "teat_end_x_mm", "unit": "mm", "value": 3.0, "sigma": 1.0},
    {"name": "liner_opening_s", "unit": "s", "value": 0.12, "sigma": 0.002},
    {"name": "liner_compression_mean_kpa", "unit": "kPa", "value": -11.800000001, "sigma": 1.1},
]


class Barn:
    """Two captures of a device, and what is known of their analyses."""

    def fields(self, capture_id: str) -> Mapping[str, object]:
        """What the analyses add to a capture's document."""
        return {"analysis": self.analyses.of(capture_id)}

    def analysed(self, captures: Collection[str] | None) -> Collection[str]:
        """The captures that have an analysis."""
        return self.store.among(captures)

    def __init__(self, folder: Path) -> None:
        captures = folder / "captures"
        captures.mkdir(exist_ok=True)
        for name in ("a", "b"):
            if not (captures / f"{name}.grab").exists():
                device = {"name": "cup"}
                write(captures, slots(2), name=name, id=name, device=device, labels={"cow": "=1+1"}, note="n")
        self.jobs = jobs_in(folder, ended=lambda job, captures: self.analyses.ended(captures))
        self.archive = Archive(captures, list, results=self)
        self.archive.index.rebuild()
        self.store = AnalysisStore(folder / "analyses")
        self.store.open()
        self.analyses = CaptureAnalyses(self.store, self.jobs.queue, self.archive.index)
        self.analyses.open(reversed(self.jobs.queue.list()))

    def analyse(self, capture: str, number: int = 1, **record: Any) -> None:
        """A job that makes an analysis."""
        job = self.begin(capture)
        folder = self.store.directory / capture / str(number)
        folder.mkdir(parents=True)
        known = {"created_utc": f"2026-03-0{number}", "quantities": QUANTITIES, **record}
        (folder / "record.json").write_text(json.dumps(known))
        self.jobs.queue.end(job, JobState.DONE)

    def begin(self, capture: str) -> int:
        """A job that analyses runs."""
        number = int(self.jobs.queue.submit(AnalysisJob(subject=capture)).id[4:])
        assert self.jobs.queue.begin(number)
        return number


@pytest.fixture
def barn(tmp_path: Path) -> Barn:
    return Barn(tmp_path)


def test_a_capture_that_nobody_analysed_has_none(barn: Barn) -> None:
    assert barn.archive.document("a").analysis is None
    assert barn.analyses.latest == {}


def test_an_analysis_is_shown_with_its_main_quantities_that_were_found(barn: Barn) -> None:
    barn.analyse("a")
    analysis = barn.archive.document("a").analysis
    assert analysis is not None
    assert (analysis.state, analysis.analysis, analysis.created_utc) == ("done", 1, "2026-03-01")
    assert [(one.name, one.value, one.sigma, one.unit) for one in analysis.quantities] == [
        ("liner_compression_mean_kpa", -11.800000001, 1.1, "kPa"),
        ("liner_opening_s", 0.12, 0.002, "s"),
        ("rate_per_min", 60.2, 0.1, "1/min"),
    ]


def test_while_another_one_runs_the_newest_that_there_is_is_shown(barn: Barn) -> None:
    barn.analyse("a", 1)
    number = barn.begin("a")
    analysis = barn.archive.document("a").analysis
    assert analysis is not None
    assert (analysis.state, analysis.job, analysis.analysis) == ("running", f"job-{number}", 1)
    barn.jobs.queue.end(number, JobState.FAILED, problem=PROBLEM)
    failed = barn.archive.document("a").analysis
    assert failed is not None
    assert (failed.state, failed.job, failed.analysis, failed.problem) == ("failed", None, 1, PROBLEM)
    barn.analyse("a", 2)
    assert barn.archive.document("a").analysis == analysis.model_copy(
        update={"state": "done", "job": None, "analysis": 2, "created_utc": "2026-03-02"}
    )


def test_of_an_earlier_version_or_a_damaged_one_the_quantities_are_unknown(barn: Barn) -> None:
    barn.analyse("a", quantities=[])
    assert barn.archive.document("a").analysis == CaptureAnalysis(
        state="done", analysis=1, created_utc="2026-03-01"
    )
    barn.analyse("b", quantities="many")
    damaged = barn.archive.document("b").analysis
    assert damaged is not None
    assert damaged.problem
    assert "analysis 1 cannot be read" in damaged.problem.message


def test_the_latest_of_a_device_is_the_one_that_ended_last_and_is_known_after_a_restart(
    barn: Barn, tmp_path: Path
) -> None:
    barn.analyse("b")
    barn.jobs.queue.end(barn.begin("a"), JobState.FAILED, problem=PROBLEM)
    latest = barn.analyses.latest["cup"]
    assert (latest.capture, latest.state, latest.problem) == ("a", "failed", PROBLEM)
    assert Barn(tmp_path).analyses.latest == barn.analyses.latest


def test_the_list_as_a_table_has_labels_and_quantities_as_columns(barn: Barn) -> None:
    barn.analyse("a")
    text = captures_csv([barn.archive.document(name) for name in ("a", "b")])
    head, first, second = (line.split(",") for line in text.splitlines())
    row, other = (dict(zip(head, line, strict=True)) for line in (first, second))
    assert (row["id"], row["label_cow"], row["analysis_state"], row["analysis"]) == (
        "a",
        "'=1+1",
        "done",
        "1",
    )
    assert (row["liner_compression_mean_kpa"], row["sigma_liner_compression_mean_kpa"]) == ("-11.8", "1.1")
    assert (row["teat_end_beyond_flow_stop_kpa"], row["wall_ratio"]) == ("", "")
    assert (other["id"], other["analysis_state"], other["rate_per_min"]) == ("b", "", "")
