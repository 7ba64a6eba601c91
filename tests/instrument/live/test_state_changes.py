"""What has changed since: small, and enough to have the new from the old."""

import json
from typing import Any

from hypothesis import given
from hypothesis import strategies as st
from merge_patch import merged

from grabberd.instrument.live.state import History, changes

VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.text(max_size=3) | st.lists(st.integers(), max_size=2),
    lambda inner: st.dictionaries(st.sampled_from("abc"), inner, max_size=3),
    max_leaves=5,
)
DOCUMENTS = st.dictionaries(st.sampled_from("abcd"), VALUES, max_size=4)


def without_nulls(value: Any) -> Any:
    """As a client sees it to whom a null and a missing key are the same."""
    if not isinstance(value, dict):
        return value
    return {key: without_nulls(inner) for key, inner in value.items() if inner is not None}


def test_only_what_differs_is_told() -> None:
    before = {"state": "ready", "ring": {"slots": 32, "bits": 1}, "warnings": ["a"]}
    after = {"state": "ready", "ring": {"slots": 32, "bits": 8}, "warnings": ["a", "b"]}
    assert changes(before, after) == {"ring": {"bits": 8}, "warnings": ["a", "b"]}


def test_a_value_that_becomes_null_and_a_key_that_goes_are_null() -> None:
    assert changes({"cause": "unplugged", "live": {"n": 1}}, {"cause": None}) == {"live": None, "cause": None}


@given(DOCUMENTS, DOCUMENTS)
def test_a_document_with_its_changes_is_the_new_one(before: dict[str, Any], after: dict[str, Any]) -> None:
    assert without_nulls(merged(before, changes(before, after))) == without_nulls(after)


@given(DOCUMENTS)
def test_nothing_has_changed_in_the_same(document: dict[str, Any]) -> None:
    assert changes(document, json.loads(json.dumps(document))) == {}


def test_a_document_as_it_was_is_no_new_version() -> None:
    history = History()
    first = history.enter({"a": 1})
    assert first is not None
    assert (first.number, history.enter({"a": 1})) == (1, None)


def test_the_oldest_versions_are_forgotten() -> None:
    history = History(kept=2)
    for a in range(3):
        history.enter({"a": a})
    assert history.find(1) is None
    assert [version and version.document["a"] for version in map(history.find, (2, 3))] == [1, 2]
