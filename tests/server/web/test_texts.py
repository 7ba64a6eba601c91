"""Both languages say the same things, and the page says nothing that there is no text for."""

import ast
import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from grabberd.config import shipped_configs
from grabberd.core.chain.calibration import acceptance
from grabberd.core.reconstruction.coverage import CoverageVerdict, FindingCode
from grabberd.core.reconstruction.points import Miss
from grabberd.errors import Cause
from grabberd.server.web.page import AFTER, AT_ONCE, FIRST_TEXTS, LANGUAGES, STATIC
from grabberd_liner.chain.guided_tests.recipes import RECIPES

CALL = re.compile(r"""\bt[nl]?\(\s*(?P<quote>["'`])(?P<key>[a-z]\w*\.(?:(?!(?P=quote)).)+)(?P=quote)""")
"""t("key"), tn("key"), tl("key"); a template's places stand for any name."""
NAMED = re.compile(r"""["'`](?P<key>[a-z]\w*(?:\.(?:\w+|\$\{[^}]*\}))+)["'`]""")
"""A key that is handed on: a title, a choice between two texts."""
PLURAL = (".one", ".other")


def catalogue(language: str) -> dict[str, Any]:
    files = sorted((STATIC / "texts" / language).glob("*.json"))
    return {file.stem: json.loads(file.read_text(encoding="utf-8")) for file in files}


def flat(document: Any, name: str = "") -> Iterator[tuple[str, Any]]:
    if not isinstance(document, dict):
        yield name, document
        return
    for key, value in document.items():
        yield from flat(value, f"{name}.{key}" if name else key)


TEXTS = {language: dict(flat(catalogue(language))) for language in LANGUAGES}
SOURCES = {
    path.relative_to(STATIC).as_posix(): path.read_text(encoding="utf-8")
    for path in sorted((STATIC / "js").rglob("*.js"))
}
CALLED = {key for source in SOURCES.values() for key in (match["key"] for match in CALL.finditer(source))}
MENTIONED = CALLED | {match["key"] for source in SOURCES.values() for match in NAMED.finditer(source)}


def reason_codes() -> set[str]:
    """The codes with which the acceptance of a calibration makes a `Reason`."""
    modules = [Path(one) for folder in acceptance.__path__ for one in Path(folder).glob("*.py")]
    calls = [node for one in modules for node in ast.walk(ast.parse(one.read_text("utf-8")))]
    return {
        str(call.args[0].value)
        for call in calls
        if isinstance(call, ast.Call)
        and ast.unparse(call.func).lower().endswith(("reason", "remark"))
        and call.args
        and isinstance(call.args[0], ast.Constant)
    }


def as_pattern(key: str) -> re.Pattern[str]:
    parts = re.split(r"\$\{[^}]*\}", key)
    return re.compile(r"[\w -]*".join(map(re.escape, parts)) + r"(\.one|\.other)?")


def places(text: Any) -> list[set[str]]:
    texts = text if isinstance(text, list) else [text]
    return [set(re.findall(r"\{(\w+)\}", one)) for one in texts]


def test_both_languages_have_the_same_keys() -> None:
    assert sorted(TEXTS["en"]) == sorted(TEXTS["nb"])


def test_the_first_view_has_its_texts_at_once() -> None:
    catalogues = catalogue("en")
    first = {name: source for name, source in SOURCES.items() if name.startswith((*AT_ONCE, *AFTER))}
    needed = {
        match["key"].partition(".")[0]: name
        for name, source in first.items()
        for match in NAMED.finditer(source)
    }
    late = {key: name for key, name in needed.items() if key in catalogues and key not in FIRST_TEXTS}
    assert late == {}


def test_both_languages_fill_in_the_same_places() -> None:
    differing = {key for key, text in TEXTS["en"].items() if places(text) != places(TEXTS["nb"][key])}
    assert differing == set()


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_cause_of_the_daemon_has_what_it_is_why_it_may_be_and_what_to_try(language: str) -> None:
    known = catalogue(language)["causes"]
    assert sorted(known) == sorted(Cause)
    assert all(set(texts) == {"what", "why", "try"} for texts in known.values())


FORMER_REASONS = ("alike", "mirrored", "runner_up")
"""Reasons of earlier versions, whose reports are still read."""


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_reason_of_an_acceptance_has_what_it_is_and_what_to_do(language: str) -> None:
    known = catalogue(language)["calibration"]["acceptance"]
    assert set(known) == {*reason_codes(), *FORMER_REASONS}
    assert all(set(texts) == {"what", "do"} for texts in known.values())


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_verdict_finding_and_miss_of_a_run_has_a_text(language: str) -> None:
    known = catalogue(language)["captures"]
    misses = {one.key for one in Miss if Miss.FOUND < one <= Miss.TAKEN}
    assert set(known["measured"]) == set(CoverageVerdict)
    assert set(known["finding"]) == set(FindingCode)
    assert set(known["missAll"]) == misses
    assert set(known["miss"]) == misses | {"displaced"}


def test_the_reference_explains_every_finding_and_miss_of_a_run() -> None:
    page = (shipped_configs().parent / "docs" / "reference" / "coverage.md").read_text("utf-8")
    codes = [*FindingCode, *CoverageVerdict, *(one.key for one in Miss if one is not Miss.FOUND)]
    assert [code for code in codes if f"`{code}`" not in page] == []


def test_the_reference_explains_every_reason_of_an_acceptance() -> None:
    page = (shipped_configs().parent / "docs" / "reference" / "acceptance.md").read_text("utf-8")
    assert [code for code in reason_codes() if f"`{code}`" not in page] == []


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_step_of_a_guided_test_has_plain_words_of_its_own(language: str) -> None:
    known = catalogue(language)["tests"]
    steps = {kind: {step.name for step in recipe.steps} for kind, recipe in RECIPES.items()}
    assert {kind: set(words) for kind, words in known["step"].items()} == steps
    assert set(known["kind"]) == set(known["about"]) == set(RECIPES)


@pytest.mark.parametrize("language", LANGUAGES)
def test_no_text_is_empty(language: str) -> None:
    assert [key for key, text in TEXTS[language].items() if not text] == []


def test_every_key_that_is_asked_for_has_a_text() -> None:
    patterns = {key: as_pattern(key) for key in CALLED}
    missing = [
        key for key, pattern in patterns.items() if not any(pattern.fullmatch(known) for known in TEXTS["en"])
    ]
    assert missing == []


def test_every_text_is_used_somewhere() -> None:
    patterns = [as_pattern(key) for key in MENTIONED]
    unused = [key for key in TEXTS["en"] if not any(pattern.fullmatch(key) for pattern in patterns)]
    assert unused == []
