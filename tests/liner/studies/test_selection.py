"""What a study is asked for, in words."""

from pathlib import Path

import pytest

from grabberd.errors import InputError
from grabberd_liner.chain.study.study import Studied, unanalysed
from grabberd_liner.studies.captures import Condition, Selection


def capture(utc: str = "2026-11-05T06:00:00.000Z", verdict: str = "complete", **labels: str) -> Studied:
    return unanalysed("c1", utc, "barn", verdict, labels=labels)


def taken(words: list[str], one: Studied) -> bool:
    return Selection.of(words).matches(one)


def test_all_conditions_have_to_be_met_and_a_comma_gives_alternatives() -> None:
    assert taken(["liner=A,B", "cow=112"], capture(liner="B", cow="112"))
    assert not taken(["liner=A,B", "cow=112"], capture(liner="C", cow="112"))
    assert not taken(["liner=A,B", "cow=112"], capture(liner="A"))


def test_labels_are_compared_letter_for_letter() -> None:
    assert not taken(["cow=112"], capture(cow="0112"))
    assert not taken(["liner=a"], capture(liner="A"))


@pytest.mark.parametrize(
    ("word", "is_taken"),
    [
        ("since=2026-11-05", True),
        ("since=2026-11-06", False),
        ("since=2026-11-05T07:00+01:00", True),
        ("since=2026-11-05T06:00:01", False),
        ("until=2026-11-05", False),
        ("until=2026-11-06", True),
        ("until=2026-11-05T06:00", False),
    ],
)
def test_times_are_in_utc_since_is_included_until_is_not(word: str, is_taken: bool) -> None:
    assert taken([word], capture()) is is_taken


def test_device_verdict_id_and_day_are_conditions_too() -> None:
    assert taken(["device=barn", "verdict=complete", "id=c1,c2", "date=2026-11-05"], capture())
    assert not taken(["verdict=incomplete"], capture())


def test_a_verdict_that_is_not_yet_known_can_be_left_aside() -> None:
    asked = Selection.of(["verdict=complete", "liner=A"])
    assert asked.matches(capture(verdict="", liner="A"), but_verdict=True)
    assert not asked.matches(capture(verdict="", liner="B"), but_verdict=True)


def test_what_exists_is_a_folder_whatever_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "liner=A").mkdir()
    (tmp_path / "report.json").write_text("{}")
    asked = Selection.of(["liner=A", "report.json", "cow=1"])
    assert asked.folders == (Path("liner=A"), Path())
    assert asked.conditions == (Condition("cow", ("1",)),)


def test_a_capture_is_refused_with_the_command_that_analyses_it(tmp_path: Path) -> None:
    (tmp_path / "liner.grab").touch()
    for name in ("liner.grab", "gone.grab"):
        with pytest.raises(InputError, match="is a capture, and a study takes analyses") as refused:
            Selection.of([str(tmp_path / name)])
        assert f"grabberd analyse {tmp_path / name}" in refused.value.hint


@pytest.mark.parametrize(
    ("word", "said"),
    [
        ("resluts", "does not exist, and is no condition"),
        ("liner=", "is no condition"),
        ("=A", "is no condition"),
        ("since=yesterday", "no day or time"),
        ("since=2026-11-01,2026-11-02", "several times"),
        ("verdict=good", "no verdict good"),
    ],
)
def test_other_words_are_refused_with_a_hint(word: str, said: str) -> None:
    with pytest.raises(InputError, match=said) as refused:
        Selection.of([word])
    assert refused.value.hint


def test_a_file_that_is_no_folder_is_refused(tmp_path: Path) -> None:
    (tmp_path / "report.html").touch()
    with pytest.raises(InputError, match=r"report.html is no folder"):
        Selection.of([str(tmp_path / "report.html")])


def test_the_only_value_of_a_condition_can_be_asked_of_a_daemon() -> None:
    asked = Selection.of(["device=barn", "liner=A,B"])
    assert (asked.single("device"), asked.single("liner"), asked.single("since")) == ("barn", None, None)
