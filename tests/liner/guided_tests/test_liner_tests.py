"""Guided tests as the daemon knows them: listed, declared, accepted, and told of with their device."""

from pathlib import Path
from typing import Any

import pytest
from queued_jobs import Jobs, jobs_in
from slots import ManualClock

from archive.captures import slots, write
from archive.liner_tests import FAILED, damage, stored_test
from grabberd.archive.catalogue.archive import Archive
from grabberd.documents.document import JobProblem
from grabberd.documents.enums import JobState
from grabberd.errors import Conflict, InputError, NotFound
from grabberd_liner.guided_tests.documents import LinerTestRequest, LinerTestResult, LinerTestRow
from grabberd_liner.guided_tests.job import LinerTestJob
from grabberd_liner.guided_tests.liner_tests import LinerTests
from grabberd_liner.guided_tests.store import LinerTestStore
from grabberd_liner.profiles.documents import ProfileDocument
from grabberd_liner.profiles.profiles import Profiles
from liner.chain.analysis.profiling import LINER, changed

STIFFER = changed(LINER, "material.E_mpa", 3.4)


class Barn:
    """Captures, profiles and tests of one state directory."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder / "captures"
        self.folder.mkdir(exist_ok=True)
        self.jobs: Jobs = jobs_in(
            folder, clock=ManualClock(), ended=lambda job, captures: self.tests.ended(job)
        )
        self.archive = Archive(self.folder, list)
        self.archive.index.rebuild()
        self.profiles = Profiles(folder / "state.sqlite", lambda document: [], ManualClock())
        self.profiles.open()
        self.store = LinerTestStore(folder / "tests")
        self.store.open()
        self.tests = LinerTests(self.store, self.archive, self.profiles)
        self.tests.open(reversed(self.jobs.queue.list()))

    def capture(self, name: str, created_utc: str = "2026-03-01T09:30:00.000Z", **labels: str) -> str:
        """A sealed capture of the device `cup`."""
        path = write(
            self.folder,
            slots(2),
            name=name,
            id=name,
            created_utc=created_utc,
            labels=labels,
            device={"name": "cup"},
        )
        self.archive.index.add(path)
        return name

    def end(self, subject: str, state: JobState, **outcome: Any) -> str:
        """A job that tests a capture ends; returns its id."""
        job = self.jobs.queue.submit(LinerTestJob(subject=subject, test="ramp"))
        self.jobs.queue.begin(int(job.id[4:]))
        self.jobs.queue.end(int(job.id[4:]), state, **outcome)
        return job.id


@pytest.fixture
def barn(tmp_path: Path) -> Barn:
    return Barn(tmp_path)


def offering(after: int, **changes: Any) -> dict[str, Any]:
    return {"offer": {"profile": STIFFER, "after": after, "changes": ["E_mpa: 3 becomes 3.4"]}, **changes}


# --- listed ---


def rows_of(barn: Barn, **wanted: str) -> list[LinerTestRow]:
    """The tests that a list has, newest first."""
    found = (barn.tests.row(test_id, **wanted) for test_id in barn.store.ids())
    return [row for row in found if row is not None]


def test_the_newest_comes_first_with_verdict_and_quantities(barn: Barn) -> None:
    first, second = stored_test(barn.store, 1), stored_test(barn.store, 2, verdict="failed", checks=[FAILED])
    rows = rows_of(barn)
    assert [(row.id, row.verdict, row.offers) for row in rows] == [
        (second, "failed", False),
        (first, "passed", False),
    ]
    assert (rows[1].kind, rows[1].liner, rows[1].captures) == ("ramp", "A", ["c1"])
    assert [one.name for one in rows[1].quantities] == ["touch_kpa"]


def test_a_list_is_narrowed_to_a_recipe_or_a_liner_however_its_name_is_typed(barn: Barn) -> None:
    ramp = stored_test(barn.store, 1, liner="Bla\u030aros")
    wear = stored_test(barn.store, 2, kind="wear", liner=None)
    assert [row.id for row in rows_of(barn, kind="wear")] == [wear]
    assert [row.id for row in rows_of(barn, liner="Bl\u00e5ros")] == [ramp]
    assert rows_of(barn, kind="wear", liner="Bl\u00e5ros") == []


def test_a_damaged_one_is_listed_with_its_problem(barn: Barn) -> None:
    test_id = stored_test(barn.store)
    damage(barn.store, test_id)
    (row,) = rows_of(barn)
    assert (row.id, row.kind, row.verdict) == (test_id, None, None)
    assert row.problem
    assert "test.json" in row.problem


# --- asked for by hand ---


def test_captures_are_put_in_order_with_what_their_labels_find(barn: Barn) -> None:
    barn.profiles.put(LINER)
    later = barn.capture("a", "2026-03-02T09:30:00.000Z", liner="A", known_kpa="2")
    earlier = barn.capture("b", liner="A", known_kpa="0")
    job = barn.tests.job(
        LinerTestRequest(kind="artificial-teat", captures=[later, earlier], inputs={"phases": 4})
    )
    assert (job.test, job.captures, job.subject) == ("artificial-teat", ("b", "a"), "a")
    assert job.inputs == {"phases": 4}
    assert {one: found.labels["known_kpa"] for one, found in job.profiles.items()} == {"a": "2", "b": "0"}
    assert [one.name for one in job.profiles["b"].profiles] == ["A"]


@pytest.mark.parametrize(
    ("kind", "captures", "words"),
    [
        ("ramp", ["a", "b"], "the test ramp is of one capture, and 2 are named"),
        ("wear", ["a"], "the test wear compares captures, and one is named"),
        ("wear", ["a", "b"], "captures are of several liners: A, B"),
        ("wear", ["a", "none"], "captures are of several liners: A, none"),
    ],
)
def test_captures_that_a_recipe_does_not_evaluate_together_are_refused(
    barn: Barn, kind: Any, captures: list[str], words: str
) -> None:
    barn.capture("a", liner="A")
    barn.capture("b", liner="B")
    barn.capture("none")
    with pytest.raises(InputError, match=words):
        barn.tests.job(LinerTestRequest(kind=kind, captures=captures))


def test_a_capture_that_does_not_exist_is_named(barn: Barn) -> None:
    with pytest.raises(NotFound, match="c9"):
        barn.tests.job(LinerTestRequest(kind="ramp", captures=["c9"]))


# --- accepted ---


def newest(barn: Barn) -> ProfileDocument:
    return barn.profiles.get("liner", "A")


def test_what_is_offered_becomes_the_next_version_once(barn: Barn) -> None:
    barn.profiles.put(LINER)
    test_id = stored_test(barn.store, **offering(1))
    accepted = barn.tests.accept(test_id)
    assert (accepted.version, accepted.profile) == (2, STIFFER)
    assert barn.tests.accept(test_id) == accepted
    assert newest(barn) == accepted


def test_a_liner_without_a_profile_gets_its_first(barn: Barn) -> None:
    assert barn.tests.accept(stored_test(barn.store, **offering(0))).version == 1


def test_an_offer_that_a_newer_version_overtook_is_refused(barn: Barn) -> None:
    barn.profiles.put(LINER)
    test_id = stored_test(barn.store, **offering(1))
    barn.profiles.put(changed(LINER, "note", "remounted"))
    with pytest.raises(Conflict, match=r"version 2 .* is the newest, not 1"):
        barn.tests.accept(test_id)
    assert newest(barn).version == 2


def test_so_is_one_whose_profile_went_on_after_it_was_stored(barn: Barn) -> None:
    barn.profiles.put(LINER)
    test_id = stored_test(barn.store, **offering(1))
    barn.tests.accept(test_id)
    barn.profiles.put(changed(STIFFER, "note", "remounted"))
    with pytest.raises(Conflict, match=r"version 3 .* is the newest, not 1"):
        barn.tests.accept(test_id)


def test_a_test_without_an_offer_says_so(barn: Barn) -> None:
    with pytest.raises(Conflict, match="has nothing to offer"):
        barn.tests.accept(stored_test(barn.store))
    with pytest.raises(NotFound, match="no test"):
        barn.tests.accept("job-7")


# --- with its device ---


def test_the_latest_of_a_device_is_the_one_that_ended_last_and_is_known_after_a_restart(
    barn: Barn, tmp_path: Path
) -> None:
    barn.capture("c1", liner="A")
    test_id = stored_test(barn.store)
    result = LinerTestResult(test=test_id, kind="ramp", verdict="passed", analyses=[1])
    barn.end("c1", JobState.DONE, result=result)
    latest = barn.tests.latest["cup"]
    assert (latest.capture, latest.state, latest.problem) == ("c1", "done", None)
    assert latest.test == rows_of(barn)[0]
    assert Barn(tmp_path).tests.latest == barn.tests.latest
    problem = JobProblem(message="the wall does not buckle", hint="let the vacuum fall further")
    barn.end("c1", JobState.FAILED, problem=problem)
    failed = barn.tests.latest["cup"]
    assert (failed.state, failed.test, failed.problem) == ("failed", None, problem)


def test_other_jobs_and_captures_that_are_gone_change_nothing(barn: Barn) -> None:
    barn.end("gone", JobState.CANCELLED)
    assert barn.tests.latest == {}
