"""Jobs that were killed when their result was there already: the next attempt finds it."""

import json
from pathlib import Path

import pytest
from running import running, sealed

from archive.milkings import milking
from core.chain.milking import field, still
from grabberd.archive.capture.reader import CaptureReader
from grabberd.errors import MeasurementError
from grabberd.instrument.capture.capture_request import CaptureRequest
from grabberd.library.jobs import measurement as measuring
from grabberd.library.jobs.measurement import MeasurementJob
from grabberd.work.job_spec import JobContext
from grabberd_liner.analyses import job as analysing
from grabberd_liner.analyses.documents import AnalysisResult
from grabberd_liner.analyses.job import AnalysisJob
from grabberd_liner.analyses.store import AnalysisStore

SHAPE = {"heights_mm": [0]}


def silent(share: float) -> None:
    """Nobody looks."""


def refused(*_: object, **__: object) -> None:
    raise AssertionError("it is made already")


def test_an_analysis_is_not_made_twice(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    store = AnalysisStore(tmp_path / "analyses")
    store.open()
    files = {"c1": milking(tmp_path, still(3), "c1")}
    context = JobContext(job="job-7", files=files, folders={"analyses": store.directory})
    job = AnalysisJob(subject="c1", inputs=SHAPE)
    first = job.run(silent, context)
    assert isinstance(first, AnalysisResult)
    assert (first.analysis, first.job) == (1, "job-7")
    other = job.run(silent, JobContext(job="job-8", files=files, folders={"analyses": store.directory}))
    monkeypatch.setattr(analysing, "analyse_file", refused)
    assert job.run(silent, context) == first
    assert (other.analysis, store.numbers("c1")) == (2, [1, 2])


def test_its_quantities_are_in_its_record_with_sigma_or_reason(tmp_path: Path) -> None:
    store = AnalysisStore(tmp_path / "analyses")
    store.open()
    files = {"c1": milking(tmp_path, [field(n) for n in range(46)], "c1")}
    context = JobContext(job="job-7", files=files, folders={"analyses": store.directory})
    AnalysisJob(subject="c1", inputs={**SHAPE, "phases": 4}, pulsating=True).run(silent, context)
    record = json.loads((store.directory / "c1" / "1" / "record.json").read_text())
    found = {one["name"]: one for one in record["quantities"]}
    assert found["liner_opening_s"]["value"] > 0
    assert found["liner_opening_s"]["sigma"] > 0
    assert found["liner_compression_mean_kpa"]["value"] is None
    assert "no pressure without" in found["liner_compression_mean_kpa"]["reason"]


def test_one_that_has_to_pulsate_and_does_not_is_refused_before_the_work(tmp_path: Path) -> None:
    store = AnalysisStore(tmp_path / "analyses")
    store.open()
    files = {"c1": milking(tmp_path, still(3), "c1")}
    context = JobContext(job="job-7", files=files, folders={"analyses": store.directory})
    with pytest.raises(MeasurementError, match=r"the wall does not pulsate: .*only 3 fields"):
        AnalysisJob(subject="c1", inputs=SHAPE, pulsating=True).run(silent, context)
    assert store.numbers("c1") == []


def test_a_run_is_not_added_twice(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with running(tmp_path) as service:
        service.capture_control.start(None, CaptureRequest(fields=8))
        path = sealed(service).path
        made_with = service.instrument(None).setup.made_with
    context = JobContext(job="job-7", files={"c1": path})
    job = MeasurementJob(subject="c1", made_with=made_with)
    first = job.run(silent, context)
    monkeypatch.setattr(measuring, "measure_file", refused)
    again = job.run(silent, context)
    assert (again.run, again.fields, again.points) == (2, 8, first.points)
    assert again.coverage == first.coverage
    with CaptureReader(path) as reader:
        assert [run.kind for run in reader.runs] == ["live", "measure"]
        assert reader.runs[1].made_with["settings"]["job"] == "job-7"
