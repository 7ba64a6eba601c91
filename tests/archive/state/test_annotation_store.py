"""What is said of captures outlives the program and stays apart from their files."""

from pathlib import Path

import pytest

from grabberd.archive.state.state_database import Annotation, AnnotationStore, StateDatabase


@pytest.fixture
def store(tmp_path: Path) -> AnnotationStore:
    StateDatabase(tmp_path / "state.sqlite").open()
    return AnnotationStore(tmp_path / "state.sqlite")


def test_of_most_captures_nothing_is_said(store: AnnotationStore) -> None:
    assert store.get("one") == Annotation(pinned=False, note=None, labels=None)
    assert store.all() == {}


def test_what_was_said_last_stands(store: AnnotationStore) -> None:
    store.put("one", Annotation(pinned=True, note="ü"))
    store.put("one", Annotation(pinned=True, note="", labels={"cow": "112"}))
    store.put("two", Annotation(labels={}, marks={120: "kick", 7: "closes"}))
    assert store.get("one") == Annotation(pinned=True, note="", labels={"cow": "112"})
    assert store.all() == {
        "one": store.get("one"),
        "two": Annotation(labels={}, marks={120: "kick", 7: "closes"}),
    }


def test_it_is_forgotten_with_its_capture(store: AnnotationStore) -> None:
    store.put("one", Annotation(pinned=True))
    store.remove("one")
    store.remove("never")
    assert store.get("one") == Annotation()
