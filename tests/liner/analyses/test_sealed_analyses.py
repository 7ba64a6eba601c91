"""Captures that are sealed are queued for analysis or test: each once, whatever happens in between."""

from datetime import timedelta
from pathlib import Path
from typing import Any

import pytest
from queued_jobs import jobs_in
from running import configuration
from sealed_setups import DEVICE, SHAPE, Barn, setups_of
from slots import ManualClock

from archive.captures import slots, write
from grabberd.archive.state.state_database import Annotation, StateStore
from grabberd.config import AnalysisConfig, default_config_file
from grabberd.documents.document import JobProblem
from grabberd.documents.enums import JobState
from grabberd.errors import StorageError
from grabberd.instrument.setup import DeviceSetup, set_up
from grabberd.server.daemon.jobs import NOTE as CHECK
from grabberd.work import job_queue
from grabberd_liner.analyses.capture_analyses import AGAIN_S, inputs_of_test
from grabberd_liner.analyses.documents import CaptureAnalysis
from grabberd_liner.analyses.job import AnalysisJob
from grabberd_liner.chain.guided_tests.recipes import RECIPES
from grabberd_liner.guided_tests.job import LinerTestJob
from grabberd_liner.profiles.profiles import FoundProfiles
from liner.chain.analysis.profiling import LINER, MATERIAL, PULSATOR


@pytest.fixture
def clock() -> ManualClock:
    return ManualClock()


@pytest.fixture
def barn(tmp_path: Path, clock: ManualClock) -> Barn:
    made = Barn(tmp_path, clock)
    made.sealing.look()
    return made


def test_a_capture_that_is_sealed_is_queued_with_the_inputs_of_its_device(barn: Barn) -> None:
    barn.seal("c1")
    assert barn.queued == [], "nobody waits for it"
    barn.sealing.look()
    entry = barn.jobs.queue.first(lambda: False)
    assert entry is not None
    spec = entry.spec
    assert isinstance(spec, AnalysisJob)
    assert (spec.subject, spec.inputs, spec.pulsating) == ("c1", SHAPE, True)
    assert spec.source.endswith("inputs.yaml")
    assert entry.job.automatic
    assert barn.archive.document("c1").analysis == CaptureAnalysis(state="queued", job=entry.job.id)


def test_it_is_queued_once(barn: Barn, tmp_path: Path, clock: ManualClock) -> None:
    barn.seal("c1")
    for _ in range(3):
        barn.sealing.look()
        barn.sealing.sealed("c1", DEVICE)
    assert barn.queued == ["c1"]
    after = Barn(tmp_path, clock)
    after.sealing.look()
    assert after.queued == ["c1"]


def test_one_that_a_crash_kept_from_the_queue_is_found_at_the_next_start(
    barn: Barn, tmp_path: Path, clock: ManualClock
) -> None:
    clock.advance(60)
    for name in ("c1", "c2"):
        barn.seal(name, told=False)
    after = Barn(tmp_path, clock)
    after.sealing.look()
    assert sorted(after.queued) == ["c1", "c2"]


def test_captures_from_before_the_option_was_set_are_left_alone(tmp_path: Path, clock: ManualClock) -> None:
    before = Barn(tmp_path, clock, {})
    for name in ("old", "older"):
        before.seal(name)
    before.sealing.look()
    clock.advance(60)
    barn = Barn(tmp_path, clock)
    barn.sealing.look()
    assert before.queued == barn.queued == []
    clock.advance(60)
    barn.seal("new")
    barn.sealing.look()
    assert barn.queued == ["new"]


def test_an_option_that_is_taken_out_and_set_again_counts_from_then_on(
    barn: Barn, tmp_path: Path, clock: ManualClock
) -> None:
    clock.advance(60)
    Barn(tmp_path, clock, setups_of(tmp_path, when_sealed=False)).seal("meanwhile")
    clock.advance(60)
    again = Barn(tmp_path, clock)
    again.sealing.look()
    assert again.queued == []


def test_more_captures_than_are_read_at_once_are_all_found(
    barn: Barn, tmp_path: Path, clock: ManualClock, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("grabberd_liner.analyses.capture_analyses.AT_ONCE", 2)
    for n in range(5):
        clock.advance(1)
        barn.seal(f"c{n}", told=False)
    after = Barn(tmp_path, clock)
    after.sealing.look()
    assert sorted(after.queued) == [f"c{n}" for n in range(5)]


def test_one_that_has_an_analysis_or_failed_or_was_cancelled_is_left(
    barn: Barn, tmp_path: Path, clock: ManualClock
) -> None:
    for name in ("analysed", "failed", "cancelled", "waits"):
        barn.seal(name, told=False)
    (tmp_path / "analyses" / "analysed" / "1").mkdir(parents=True)
    queue = barn.jobs.queue
    failed, cancelled, _ = (
        queue.submit(AnalysisJob(subject=one)) for one in ("failed", "cancelled", "waits")
    )
    queue.cancel(cancelled.id)
    queue.end(int(failed.id[4:]), JobState.FAILED, problem=JobProblem(message="m", hint="h"))
    after = Barn(tmp_path, clock)
    after.sealing.look()
    assert after.queued == ["waits"]


def test_a_capture_without_points_says_so_and_is_not_tried_again(
    barn: Barn, tmp_path: Path, clock: ManualClock
) -> None:
    path = write(barn.captures, slots(2), name="empty", id="empty", device={"name": DEVICE})
    barn.archive.index.add(path)
    barn.sealing.sealed("empty", DEVICE)
    barn.sealing.look()
    analysis = barn.archive.document("empty").analysis
    assert analysis is not None
    assert analysis.state == "failed"
    assert analysis.problem
    assert "was not measured" in analysis.problem.message
    assert barn.analyses.latest[DEVICE].capture == "empty"
    assert Barn(tmp_path, clock).archive.document("empty").analysis == analysis
    assert barn.jobs.queue.list() == []


def test_captures_of_a_check_and_of_other_devices_are_left(barn: Barn) -> None:
    barn.seal("check", labels={"purpose": CHECK})
    barn.sealing.sealed("elsewhere", "another")
    barn.sealing.look()
    assert barn.queued == []
    assert barn.archive.document("check").analysis is None


def test_one_that_was_deleted_meanwhile_is_forgotten(barn: Barn) -> None:
    barn.sealing.sealed("gone", DEVICE)
    barn.seal("c1")
    barn.sealing.look()
    assert barn.queued == ["c1"]


def test_what_cannot_be_queued_now_is_found_again(barn: Barn, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object, **__: object) -> None:
        raise StorageError("queue.sqlite cannot be used: full", "make room")

    with monkeypatch.context() as patched:
        patched.setattr(barn.jobs.store, "put", full)
        barn.seal("c1")
        barn.sealing.look()
    barn.sealing.look()
    assert barn.queued == [], "not at once"
    barn.seconds += AGAIN_S
    barn.sealing.look()
    assert barn.queued == ["c1"]


def test_a_full_queue_is_waited_for(barn: Barn, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(job_queue, "MOST_WAITING", 1)
    for name in ("c1", "c2"):
        barn.seal(name)
    barn.sealing.look()
    assert barn.queued == ["c1"]
    barn.jobs.queue.cancel(barn.jobs.queue.list()[0].id)
    barn.seconds += AGAIN_S
    barn.sealing.look()
    assert barn.queued == ["c2"]


# --- guided tests ---


def test_a_capture_whose_label_names_a_test_is_tested_whether_or_not_its_device_analyses(
    tmp_path: Path, clock: ManualClock
) -> None:
    barn = Barn(tmp_path, clock, setups_of(tmp_path, when_sealed=False))
    barn.profiles.put({"kind": "liner", "name": "A"})
    barn.seal("c1", labels={"test": "ramp", "liner": "A"})
    barn.seal("c2", labels={"liner": "A"})
    barn.sealing.look()
    entry = barn.jobs.queue.first(lambda: False)
    assert entry is not None
    assert isinstance(entry.spec, LinerTestJob)
    assert (entry.spec.subject, entry.spec.test, entry.job.automatic) == ("c1", "ramp", True)
    assert [one.name for one in entry.spec.profiles["c1"].profiles] == ["A"]
    assert barn.queued == ["c1"]
    assert barn.archive.document("c1").analysis == CaptureAnalysis(state="queued", job=entry.job.id)


def test_its_test_is_its_analysis_where_the_device_has_captures_analysed(barn: Barn) -> None:
    barn.seal("c1", labels={"test": "milking"})
    for _ in range(2):
        barn.sealing.look()
        barn.sealing.sealed("c1", DEVICE)
    assert [(job.subject, job.kind) for job in barn.jobs.queue.list()] == [("c1", "test")]


def test_one_that_a_crash_kept_from_its_test_is_found_at_the_next_start(
    tmp_path: Path, clock: ManualClock
) -> None:
    setups = setups_of(tmp_path, when_sealed=False)
    before = Barn(tmp_path, clock, setups)
    clock.advance(60)
    for name, labels in (("c1", {"test": "ramp"}), ("c2", {}), ("c3", {"test": "reference"})):
        before.seal(name, told=False, labels=labels)
    after = Barn(tmp_path, clock, setups)
    after.sealing.look()
    assert sorted(after.queued) == ["c1", "c3"]
    again = Barn(tmp_path, clock, setups)
    again.sealing.look()
    assert sorted(again.queued) == ["c1", "c3"]


def test_one_that_was_labelled_after_it_was_sealed_is_found_then_too(
    tmp_path: Path, clock: ManualClock
) -> None:
    setups = setups_of(tmp_path, when_sealed=False)
    Barn(tmp_path, clock, setups).seal("c1", told=False)
    after = Barn(tmp_path, clock, setups)
    after.archive.annotations = lambda: {"c1": Annotation(labels={"test": "ramp"})}
    after.archive._annotation = after.archive.annotations().__getitem__  # type: ignore[assignment]
    after.sealing.look()
    assert after.queued == ["c1"]


def test_a_test_that_failed_or_was_cancelled_is_not_tried_again(tmp_path: Path, clock: ManualClock) -> None:
    setups = setups_of(tmp_path, when_sealed=False)
    before = Barn(tmp_path, clock, setups)
    for name in ("c1", "c2"):
        before.seal(name, labels={"test": "ramp"})
    before.sealing.look()
    second, first = before.jobs.queue.list()
    before.jobs.queue.cancel(second.id)
    before.jobs.queue.end(int(first.id[4:]), JobState.FAILED, problem=JobProblem(message="m", hint="h"))
    after = Barn(tmp_path, clock, setups)
    after.sealing.look()
    assert after.queued == []
    states = [analysis and analysis.state for name in ("c1", "c2") if (analysis := after.analyses.of(name))]
    assert states == ["failed", "cancelled"]


def test_captures_of_a_test_that_compares_several_wait_for_somebody_to_ask(barn: Barn) -> None:
    barn.seal("c1", labels={"test": "artificial-teat", "known_kpa": "2"})
    barn.sealing.look()
    assert barn.queued == []
    assert barn.archive.document("c1").analysis is None


def test_a_label_that_names_no_test_is_told_of_and_the_capture_is_an_ordinary_one(
    barn: Barn, caplog: pytest.LogCaptureFixture
) -> None:
    barn.seal("c1", labels={"test": "rampp"})
    barn.sealing.look()
    assert [job.kind for job in barn.jobs.queue.list()] == ["analyse"]
    assert "there is none 'rampp', but reference, ramp" in caplog.text


def test_a_test_without_points_says_so(barn: Barn) -> None:
    path = write(
        barn.captures, slots(2), name="c1", id="c1", device={"name": DEVICE}, labels={"test": "reference"}
    )
    barn.archive.index.add(path)
    barn.sealing.sealed("c1", DEVICE)
    barn.sealing.look()
    analysis = barn.archive.document("c1").analysis
    assert analysis is not None
    assert analysis.problem is not None
    assert "was not measured" in analysis.problem.message


@pytest.mark.parametrize(
    ("kind", "profiles", "left"),
    [
        ("milking", [], {"material", "vacuum", "reference", "plane"}),
        ("ramp", [], {"material", "plane"}),
        ("reference", [], {"material", "plane"}),
        ("milking", [LINER, PULSATOR], {"plane"}),
    ],
)
def test_a_test_takes_of_its_device_what_neither_recipe_nor_profile_states(
    tmp_path: Path, clock: ManualClock, kind: str, profiles: list[dict[str, Any]], left: set[str]
) -> None:
    inputs = {"material": MATERIAL, "vacuum": {}, "reference": {"field": 0}, "plane": "symmetry"}
    device = setups_of(tmp_path, inputs)[DEVICE]
    stored = Barn(tmp_path, clock).profiles
    found = FoundProfiles({}, [stored.put(one).document for one in profiles])
    assert inputs_of_test(RECIPES[kind], found, device).keys() == left


# --- inputs ---


def test_the_profiles_that_a_captures_labels_name_complete_the_inputs(
    tmp_path: Path, clock: ManualClock
) -> None:
    barn = Barn(tmp_path, clock, setups_of(tmp_path, inputs=None) | _without_inputs())
    barn.sealing.look()
    barn.profiles.put({"kind": "cow", "name": "112"})
    barn.seal("c1", labels={"cow": "112"})
    barn.seal("c2", labels={"cow": "113"})
    barn.sealing.look()
    entry = barn.jobs.queue.first(lambda: False)
    assert entry is not None
    assert isinstance(entry.spec, AnalysisJob)
    assert entry.spec.profiles is not None
    assert [one.name for one in entry.spec.profiles.profiles] == ["112"]
    after = jobs_in(tmp_path, clock=clock).queue.first(lambda: False)
    assert after is not None
    assert after.spec == entry.spec, "a profile's content waits on the disk as it was"
    assert barn.queued == ["c1"]
    refused = barn.archive.document("c2").analysis
    assert refused is not None
    assert refused.problem is not None
    assert "name no profile" in refused.problem.message


def _without_inputs() -> dict[str, DeviceSetup]:
    return set_up(configuration({}, analysis=AnalysisConfig(when_sealed=True)), default_config_file())


def test_times_are_kept_when_the_settings_are_recovered(
    barn: Barn, tmp_path: Path, clock: ManualClock
) -> None:
    settings = StateStore(tmp_path / "state.sqlite")
    known = settings.get("analysed_when_sealed_since")
    assert list(known) == [DEVICE]
    clock.advance(timedelta(days=3) / timedelta(seconds=1))
    settings.remove("analysed_when_sealed_since")
    barn.sealing.keep()
    assert settings.get("analysed_when_sealed_since") == known
