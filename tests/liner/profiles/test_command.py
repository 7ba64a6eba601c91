"""`grabberd profile` in a state directory; through a daemon, see the tests of the API."""

import json
from pathlib import Path
from typing import Any

import pytest
import yaml
from typer.testing import CliRunner, Result

from grabberd.cli.app import app
from grabberd.errors import GrabberdError, InputError, NotFound
from liner.chain.analysis.profiling import COW, LINER, changed


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("STATE_DIRECTORY", str(tmp_path / "state"))
    monkeypatch.delenv("GRABBERD_URL", raising=False)
    return tmp_path


def run(*words: object) -> Result:
    return CliRunner().invoke(app, ["profile", *(str(word) for word in words)])


def said(*words: object) -> str:
    result = run(*words)
    assert result.exit_code == 0, (result.output, result.exception)
    return result.stdout


def refusal(*words: object) -> str:
    error = run(*words).exception
    assert isinstance(error, GrabberdError), error
    assert error.hint
    return error.message


def file_of(folder: Path, document: dict[str, Any], name: str = "profile.yaml") -> Path:
    folder.mkdir(exist_ok=True)
    path = folder / name
    path.write_text(yaml.safe_dump(document, allow_unicode=True), "utf-8")
    return path


def test_a_profile_is_added_shown_and_listed(folder: Path) -> None:
    assert said("add", file_of(folder, LINER)) == "liner A: version 1\n"
    shown = said("show", "liner", "A")
    assert shown.startswith("# liner A, version 1, stored 20")
    assert yaml.safe_load(shown) == LINER
    [row] = json.loads(said("list", "--json"))
    assert (row["kind"], row["name"], row["version"]) == ("liner", "A", 1)
    assert "liner" in said("list", "liner")
    assert json.loads(said("list", "cow", "--json")) == []


def test_adding_it_again_makes_a_version_only_if_it_differs(folder: Path) -> None:
    said("add", file_of(folder, LINER))
    assert said("add", file_of(folder, LINER)) == "liner A: version 1, unchanged\n"
    assert said("add", file_of(folder, changed(LINER, "material.E_mpa", 3.2))) == "liner A: version 2\n"
    assert "version 1 of 2" in said("show", "liner", "A", "--version", 1)


def test_the_history_says_what_each_version_changed(folder: Path) -> None:
    for young in (3.0, 3.2, 3.1):
        said("add", file_of(folder, changed(LINER, "material.E_mpa", young)))
    rows = json.loads(said("history", "liner", "A", "--json"))
    assert [(row["version"], row["changes"]) for row in rows] == [
        (3, ["material.E_mpa: 3.2 → 3.1"]),
        (2, ["material.E_mpa: 3.0 → 3.2"]),
        (1, []),
    ]
    assert "E_mpa: 3.2 → 3.1" in said("history", "liner", "A")


def test_what_is_exported_is_what_was_added(folder: Path) -> None:
    said("add", file_of(folder, LINER))
    assert yaml.safe_load(said("export", "liner", "A")) == LINER
    said("export", "liner", "A", "--out", folder / "A.yaml")
    assert said("add", folder / "A.yaml") == "liner A: version 1, unchanged\n"
    assert "exists already" in refusal("export", "liner", "A", "--out", folder / "A.yaml")
    assert "no folder" in refusal("export", "liner", "A", "--out", folder / "no" / "A.yaml")


def test_a_retired_profile_is_shown_as_such_and_comes_back_when_it_is_added(folder: Path) -> None:
    said("add", file_of(folder, COW))
    assert "is retired" in said("retire", "cow", "112")
    assert json.loads(said("list", "--json")) == []
    assert [row["name"] for row in json.loads(said("list", "--retired", "--json"))] == ["112"]
    assert ", retired 20" in said("show", "cow", "112")
    said("add", file_of(folder, COW))
    assert [row["name"] for row in json.loads(said("list", "--json"))] == ["112"]


def test_a_folder_is_imported_whole(folder: Path) -> None:
    file_of(folder / "all", LINER, "a.yaml")
    file_of(folder / "all", COW, "b.yml")
    assert said("import", folder / "all") == "liner A: version 1\ncow 112: version 1\n"
    assert said("import", folder / "all").count("unchanged") == 2


def test_a_folder_with_a_profile_that_cannot_be_used_changes_nothing_and_all_is_said(folder: Path) -> None:
    file_of(folder / "all", LINER, "a.yaml")
    file_of(folder / "all", changed(COW, "flow_stop.sigma_kpa", None), "b.yaml")
    (folder / "all" / "c.yaml").write_text("kind: [")
    (folder / "all" / "d.yaml").write_bytes(b"\xff\xfe\xff")
    message = refusal("import", folder / "all")
    assert message.startswith("3 of 4 profiles cannot be used, so none was stored")
    assert "b.yaml: the profile '112' cannot be used: flow_stop.sigma_kpa: is missing" in message
    assert "c.yaml" in message
    assert "d.yaml" in message
    assert json.loads(said("list", "--json")) == []


def test_the_examples_are_imported_by_their_name(folder: Path) -> None:
    assert "liner example-reference: version 1" in said("import", "--examples")


@pytest.mark.parametrize("words", [(), ("folder", "--examples")])
def test_an_import_is_of_a_folder_or_of_the_examples(words: tuple[str, ...]) -> None:
    assert run("import", *words).exit_code == 2


def test_files_and_profiles_that_there_are_not_are_told(folder: Path) -> None:
    assert "nothing.yaml cannot be read" in refusal("add", folder / "nothing.yaml")
    assert "no YAML file" in refusal("import", folder)
    for words in (("show",), ("export",), ("history",), ("retire",)):
        assert isinstance(run(*words, "liner", "A").exception, NotFound)
    assert run("show", "bull", "1").exit_code == 2


def test_a_profile_without_sigma_is_refused(folder: Path) -> None:
    error = run("add", file_of(folder, changed(LINER, "material.E_sigma_mpa", None))).exception
    assert isinstance(error, InputError)
    assert "material.E_sigma_mpa: is missing, expected a σ above 0" in error.message
