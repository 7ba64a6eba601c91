"""Nothing that a program or a file sees has changed since the locks were made."""

import pytest
from tests.house.locks.differences import differences, told
from tests.house.locks.kept import KEPT
from tests.house.locks.register import LOCKS

MOST_BYTES = 1_500_000


@pytest.mark.parametrize("name", LOCKS)
def test_a_lock_holds(name: str) -> None:
    found = LOCKS[name].compared(name)
    assert not found, f"{name}: {len(found)} differences from kept/{name}.json\n{told(found)}"


def test_what_is_kept_is_that_of_the_locks_and_small() -> None:
    files = [file for file in KEPT.rglob("*") if file.is_file()]
    assert {file.stem for file in KEPT.glob("*.json")} == set(LOCKS)
    assert sum(file.stat().st_size for file in files) < MOST_BYTES


def test_a_difference_is_named_by_its_path() -> None:
    kept = {"one": {"two": [1, 2.0]}, "gone": 1}
    assert differences(kept, {"one": {"two": [1, 2.5]}, "more": 0}) == [
        "gone: is gone (1)",
        "more: is new (0)",
        "one › two[1]: 2.0 was kept, now it is 2.5",
    ]


def test_numbers_of_another_computer_may_differ_in_their_last_digits() -> None:
    assert differences({"x": 1.0}, {"x": 1.0 + 1e-12}, 1e-9) == []
    assert differences({"x": 1.0}, {"x": 1.0 + 1e-6}, 1e-9) != []
    assert differences({"x": 1.0}, {"x": 1.0 + 1e-12}) != []
