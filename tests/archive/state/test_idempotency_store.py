"""Keys are kept for as long as they are told to be."""

from pathlib import Path

import pytest

from grabberd.archive.state.state_database import IdempotencyStore, KeptAnswer, StateDatabase

DAY_1, DAY_2, DAY_3 = (f"2026-03-0{day}T09:00:00.000Z" for day in (1, 2, 3))


@pytest.fixture
def store(tmp_path: Path) -> IdempotencyStore:
    StateDatabase(tmp_path / "state.sqlite").open()
    return IdempotencyStore(tmp_path / "state.sqlite")


def test_a_new_key_is_kept_without_an_answer(store: IdempotencyStore) -> None:
    assert store.begin("one", b"digest", DAY_1, "") is None
    assert store.begin("one", b"other", DAY_2, "") == KeptAnswer(b"digest")


def test_an_answer_stays_with_its_key(store: IdempotencyStore) -> None:
    answer = KeptAnswer(b"digest", 202, "/here", b"{}")
    store.begin("one", b"digest", DAY_1, "")
    store.finish("one", answer)
    assert store.begin("one", b"digest", DAY_2, DAY_1) == answer


def test_what_is_older_is_forgotten(store: IdempotencyStore) -> None:
    store.begin("one", b"digest", DAY_1, "")
    assert store.begin("one", b"digest", DAY_3, DAY_2) is None


def test_what_was_refused_may_come_again(store: IdempotencyStore) -> None:
    store.begin("one", b"digest", DAY_1, "")
    store.forget("one")
    assert store.begin("one", b"digest", DAY_1, "") is None
