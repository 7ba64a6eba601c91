"""Scenarios are data; a mistake in one is said plainly."""

from pathlib import Path

import pytest

from grabberd_fake import KINDS

from .scenario import all_of, read

GOOD = (
    "fault: two fields dropped\nscript: [{kind: lose, at_s: 0, count: 2}]\nledger: {fields: {lost: [2, 2]}}\n"
)


def written(folder: Path, text: str) -> Path:
    path = folder / "dropped.yaml"
    path.write_text(text)
    return path


def test_a_scenario_has_its_name_from_its_file(tmp_path: Path) -> None:
    scenario = read(written(tmp_path, GOOD))
    assert (scenario.name, scenario.fault) == ("dropped", "two fields dropped")
    assert (scenario.begins_field(2.0), scenario.ends_field(2.0)) == (100, 102)


@pytest.mark.parametrize(
    ("mistake", "by", "said"),
    [
        ("fault:", "faults:", "fault: Field required"),
        ("lose", "melt", "has no 'kind' out of lose"),
        ("count", "cuont", "unknown key"),
        ("at_s: 0", "at_field: 0", "every fault needs at_s"),
        ("ledger", "legder", "legder: Extra inputs are not permitted"),
        ("lost:", "gone:", "ledger.fields.gone"),
        ("[2, 2]", "2", "ledger.fields.lost"),
        ("ledger: {fields: {lost: [2, 2]}}", "", "what costs fields has to be noticed, and nothing else"),
        (GOOD, "- a list", "no mapping of keys to values"),
        (GOOD, "fault: [", "dropped.yaml"),
    ],
)
def test_a_mistake_is_named_with_its_file_and_its_key(
    tmp_path: Path, mistake: str, by: str, said: str
) -> None:
    with pytest.raises(ValueError, match=r"^dropped\.yaml: ") as caught:
        read(written(tmp_path, GOOD.replace(mistake, by)))
    assert said in str(caught.value)


def test_every_fault_that_the_simulated_grabber_knows_is_played() -> None:
    played = {entry["kind"] for scenario in all_of() for entry in scenario.script}
    assert played == KINDS.keys()
