"""Captures are annotated beside their files, and deleted unless something needs them."""

from pathlib import Path

import pytest

from archive.captures import slots, write
from grabberd.archive.catalogue.archive import Archive, CaptureAnnotations
from grabberd.archive.state.state_database import Annotation, AnnotationStore
from grabberd.errors import Conflict, InputError, NotFound


class Busy:
    """Jobs that work on the captures named."""

    def __init__(self) -> None:
        self.subjects: set[str] = set()
        self.forgotten: list[str] = []

    def busy_subjects(self) -> set[str]:
        return self.subjects

    def check_idle(self, subject: str) -> None:
        if subject in self.subjects:
            raise Conflict(f"a job works on {subject}", "wait for it")

    def forget_capture(self, capture_id: str) -> None:
        self.forgotten.append(capture_id)


class Barn:
    """Two captures and everything that is said of them."""

    def __init__(self, folder: Path) -> None:
        self.store = AnnotationStore(folder / "state.sqlite")
        self.store.open()
        captures = folder / "captures"
        captures.mkdir()
        for name in ("a", "b"):
            write(captures, slots(2), name=name, id=name, note="as recorded", labels={"cow": "101"})
        self.archive = Archive(captures, list, list, self.store.get, self.store.all)
        self.archive.index.rebuild()
        self.jobs, self.removed = Busy(), list[str]()
        self.annotations = CaptureAnnotations(self.archive, self.store, self.jobs, self.removed.append)

    @property
    def files(self) -> set[str]:
        return {path.stem for path in self.archive.directory.glob("*.grab")}


@pytest.fixture
def barn(tmp_path: Path) -> Barn:
    return Barn(tmp_path)


def test_only_what_is_given_changes(barn: Barn) -> None:
    barn.annotations.annotate("a", pinned=True)
    assert barn.store.get("a") == Annotation(pinned=True)
    barn.annotations.annotate("a", note="")
    assert barn.store.get("a") == Annotation(pinned=True, note="")
    barn.annotations.annotate("a", labels={})
    assert barn.store.get("a") == Annotation(True, "", {"cow": "101"})
    barn.annotations.annotate("a", pinned=False)
    assert barn.store.get("a") == Annotation(False, "", {"cow": "101"})
    assert barn.store.get("b") == Annotation()


def test_labels_are_added_replaced_and_removed_by_name(barn: Barn) -> None:
    barn.annotations.annotate("a", labels={"teat": "rear right"})
    barn.annotations.annotate("a", labels={"cow": None, "teat": "front left"})
    assert barn.archive.document("a").labels == {"teat": "front left"}


def test_a_capture_has_32_labels_and_no_more(barn: Barn) -> None:
    barn.annotations.annotate("a", labels={f"label {n}": "x" for n in range(31)})
    assert len(barn.archive.document("a").labels) == 32
    with pytest.raises(InputError, match="33 labels; the limit is 32"):
        barn.annotations.annotate("a", labels={"one more": "x"})
    assert len(barn.archive.document("a").labels) == 32
    barn.annotations.annotate("a", labels={"cow": None, "one more": "x"})


def test_a_capture_that_there_is_not_is_not_annotated(barn: Barn) -> None:
    with pytest.raises(NotFound):
        barn.annotations.annotate("c", pinned=True)
    assert barn.store.all() == {}


def test_retention_spares_pinned_captures_and_those_that_a_job_needs(barn: Barn) -> None:
    barn.annotations.annotate("a", note="not pinned")
    assert barn.annotations.spared() == set()
    barn.annotations.annotate("a", pinned=True)
    barn.jobs.subjects = {"b"}
    assert barn.annotations.spared() == {"a", "b"}


def test_a_capture_is_deleted_with_all_that_is_said_of_it(barn: Barn) -> None:
    barn.annotations.annotate("a", note="x")
    barn.annotations.delete("a")
    assert (barn.files, barn.removed, barn.store.all()) == ({"b"}, ["a"], {})
    with pytest.raises(NotFound):
        barn.annotations.delete("a")


def test_neither_a_pinned_capture_nor_one_that_a_job_needs_is_deleted(barn: Barn) -> None:
    barn.annotations.annotate("a", pinned=True)
    barn.jobs.subjects = {"b"}
    for capture_id in ("a", "b"):
        with pytest.raises(Conflict):
            barn.annotations.delete(capture_id)
    assert barn.files == {"a", "b"}


def test_what_is_said_of_a_capture_stays_if_its_file_cannot_be_deleted(
    barn: Barn, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(capture_id: str) -> None:
        raise OSError("the disk says no")

    barn.annotations.annotate("a", note="x")
    monkeypatch.setattr(barn.archive, "remove", refuse)
    with pytest.raises(OSError, match="the disk says no"):
        barn.annotations.delete("a")
    assert barn.store.get("a") == Annotation(note="x")
