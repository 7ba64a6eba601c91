"""The source keeps to its own rules: words, openings of docstrings, sizes, layers, drawings."""

import ast
import re

import pytest
from tests.house.docstrings import riddles
from tests.house.drawing import ARCHITECTURE, CORE, floors, layers, threads, written
from tests.house.glossary import Ban, bans, breaches
from tests.house.houses import houses, references
from tests.house.sizes import _components, cycles, too_long
from tests.house.source import LINER, modules, words


def test_no_name_contains_a_banned_word() -> None:
    assert [str(breach) for breach in breaches()] == []


def test_a_word_is_found_in_any_form_of_a_name() -> None:
    assert words("start_capture") == words("StartCapture") == words("START_CAPTURE") == ["start", "capture"]


def test_the_glossary_bans_synonyms_everywhere_and_reserved_words_outside_their_files() -> None:
    assert bans()["intake"] == Ban("intake", "field pipeline")
    assert not bans()["intake"].allows("instrument/device/field_pipeline.py")
    assert bans()["session"].allows("archive/access.py")
    assert not bans()["session"].allows("instrument/capture/recording.py")


def test_every_docstring_opens_with_a_verb_or_a_noun_phrase() -> None:
    assert [str(one) for one in riddles()] == []


def test_no_module_imports_another_in_a_circle() -> None:
    assert cycles() == []


def test_a_circle_would_be_found() -> None:
    assert sorted(map(sorted, _components({"a": {"b"}, "b": {"c"}, "c": {"a"}, "d": {"a"}}))) == [
        ["a", "b", "c"],
        ["d"],
    ]


def test_no_file_is_longer_than_a_reader_takes_in() -> None:
    assert too_long() == {}


def test_every_module_parses_and_belongs_to_a_room() -> None:
    houses = {
        "grabberd": {room for layer in layers() for room in layer} | {"__main__"},
        CORE: {room for layer in layers(CORE) for room in layer},
        LINER: {*floors(LINER), *(path.stem for path in modules()[LINER].parent.glob("*.py"))},
    }
    for name, path in modules().items():
        ast.parse(path.read_text(encoding="utf-8"))
        for house, rooms in houses.items():
            if name.startswith(f"{house}."):
                assert name.removeprefix(f"{house}.").split(".")[0] in rooms


def test_the_drawing_of_the_rooms_is_that_of_the_layers() -> None:
    assert written() == ARCHITECTURE.read_text(encoding="utf-8"), "run `make house`"


def test_every_thread_of_the_daemon_is_in_the_drawing() -> None:
    drawn = set(re.findall(r"^\| (`[^|]*|[^|]*`[^|]*)\|", ARCHITECTURE.read_text(encoding="utf-8"), re.M))
    # Processes of their own have threads of their own, which are not the daemon's.
    for name, module in threads():
        if not module.startswith(("grabberd_reprocess", "grabberd.work.child")):
            assert any(name in row for row in drawn), f"{module} starts the thread {name}"


def test_every_module_belongs_to_a_house() -> None:
    assert set(houses()) == set(modules())


@pytest.mark.parametrize("house", ["ground", "core", "instrument", "outlets", "drivers"])
def test_nobody_but_the_liner_science_names_the_liner_science(house: str) -> None:
    assert references(house, "liner") == []


@pytest.mark.parametrize("house", ["instrument", "liner", "outlets", "drivers"])
def test_the_core_names_nothing_above_it(house: str) -> None:
    assert references("core", house) == references("ground", house) == []


def test_a_string_that_names_a_module_is_a_reference() -> None:
    found = {one.named for one in references("liner", "liner")}
    assert "grabberd_liner.analyses.job" in found
