"""Pictures of our own through the kernel: played into the test device's output, taken from its input."""

import pytest

from proofs.vm.guest import loop, vivid
from proofs.vm.machine import Machine


@pytest.fixture
def looped(timed: Machine) -> Machine:
    """What is played comes back."""
    timed.call(vivid.load_loop)
    return timed


def test_the_kernels_own_tool_gets_what_was_played(looped: Machine) -> None:
    numbers = looped.call(vivid.grabbed_by_v4l2_ctl, count=25, film_frames=10)["numbers"]
    assert None not in numbers
    assert all(bottom == top + 1 for top, bottom in zip(numbers[0::2], numbers[1::2], strict=True))


def test_every_pixel_of_every_field_is_what_was_played_and_in_order(looped: Machine) -> None:
    seen = looped.call(loop.seen, frames=250, film_frames=20, field_order="interlaced", format="GREY")
    assert seen["granted"] == "top_first GREY"
    assert (seen["fields"], seen["wrong"], seen["strange_parity"], seen["out_of_step"]) == (500, 0, 0, 0)
