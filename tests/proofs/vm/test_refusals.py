"""What cannot be used is refused with its reason and what to do, by a real kernel's answers."""

import pytest

from proofs.vm.guest import refusals, vivid
from proofs.vm.machine import Machine


@pytest.fixture
def patterns(timed: Machine) -> Machine:
    """A device of the usual kind."""
    if not timed.call(vivid.draws_patterns):
        timed.call(vivid.load_patterns)
    return timed


def test_a_device_that_another_program_streams_from_is_in_use(patterns: Machine) -> None:
    refusal = patterns.call(refusals.while_another_streams)
    assert refusal["kind"] == "DeviceRefused"
    assert "in use" in refusal["message"]


def test_a_device_without_rights_to_it_names_the_group_that_has_them(patterns: Machine) -> None:
    refusal = patterns.call(refusals.without_rights)
    assert refusal["kind"] == "DeviceRefused"
    assert "video" in refusal["hint"]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"device": "/dev/video9"}, "there is no"),
        ({"device": "/dev/null"}, "/dev/null"),
        ({"input": "SCART"}, "has no input"),
    ],
    ids=["no such node", "no video node", "no such input"],
)
def test_a_wrong_choice_is_named(patterns: Machine, options: dict[str, str], words: str) -> None:
    refusal = patterns.call(refusals.of, **options)
    assert words in refusal["message"]
    assert refusal["hint"]


def test_after_every_refusal_the_device_opens(patterns: Machine) -> None:
    assert patterns.call(refusals.of) is None


def test_nodes_that_deliver_no_pictures_are_refused(timed: Machine) -> None:
    by_name = timed.call(refusals.of_other_nodes)
    timed.call(vivid.unload)
    capture = [name for name, refusal in by_name.items() if refusal is None]
    assert len(by_name) > 5
    assert capture == ["vivid-000-vid-cap"]
