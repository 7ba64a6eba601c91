"""Changes of a profile in words."""

from grabberd_liner.profiles.changes import changes_in_words
from liner.chain.analysis.profiling import LINER, changed


def test_no_change_has_no_words() -> None:
    assert changes_in_words(LINER, LINER) == []


def test_each_key_that_differs_is_named_with_both_values() -> None:
    after = changed(changed(changed(LINER, "material.E_mpa", 3.2), "maker", None), "age_milkings", 40)
    assert changes_in_words(LINER, after) == [
        "maker: Example → –",
        "material.E_mpa: 3.0 → 3.2",
        "age_milkings: – → 40",
    ]


def test_entries_of_lists_are_numbered_and_long_texts_cut() -> None:
    words = changes_in_words({"zones": [{"rows": [0, 1]}]}, {"zones": [{"rows": [0, 2]}], "note": "x" * 99})
    assert words == ["zones[0].rows[1]: 1 → 2", f"note: – → {'x' * 60}…"]
