"""What goes wrong with drivers, played through the driver and the numbering: the account is true, or says by
how much it may be off.
"""

import random

import pytest

from drivers.v4l2.bench import card_with, dongle
from drivers.v4l2.playing import Play
from grabberd.core.ledger import Rebase
from grabberd_v4l2 import abi

SECONDS = 5.0
CARDS = {
    "fields of bttv": lambda: card_with(driver="bttv", formats=("GREY",)),
    "fields of vivid": lambda: card_with(driver="vivid", formats=("GREY",), numbering="fields"),
    "frames of em28xx": lambda: dongle(formats=("GREY",)),
}
EVERY_CARD = pytest.mark.parametrize("card", CARDS)
WOVEN = ("frames of em28xx",)


@pytest.fixture
def play(tmp_path):
    def made(card, **options):
        return Play(tmp_path, CARDS[card](), **options)

    return made


def is_true(one, *, lost=None, because=None):
    """The account has no lie; and where all is certain, exactly what was lost, for its reason."""
    assert one.lies == []
    if not one.uncertain:
        assert one.missing == one.truly_missing
    if lost is not None:
        assert len(one.truly_missing) == lost
        assert one.uncertain == []
    if because is not None:
        assert one.causes == because
    return True


@EVERY_CARD
def test_a_steady_stream_is_complete(play, card):
    one = play(card).run(SECONDS)
    assert is_true(one, lost=0)
    assert one.ledger.complete
    assert one.rebases == []
    assert len(one.slots) > 220


@EVERY_CARD
def test_buffers_lost_on_the_bus_are_lost_to_bus_or_cable(play, card):
    one = play(card)
    one.card.lost = {40, 41, 60}
    one.run(SECONDS)
    assert is_true(one, lost=6 if card in WOVEN else 3)
    assert one.causes <= {"time gap", "sequence gap"}
    assert one.board.now.losses == {"cable": len(one.missing)}


@EVERY_CARD
def test_buffers_lost_unseen_by_the_driver_are_found(play, card):
    one = play(card)
    one.card.lost = one.card.uncounted = {40, 41, 60}
    assert is_true(one.run(SECONDS), lost=6 if card in WOVEN else 3)


@EVERY_CARD
@pytest.mark.parametrize("seed", range(3))
def test_stamps_with_a_heavy_tail_lose_nothing_and_invent_nothing(play, card, seed):
    one, draw = play(card), random.Random(seed)
    newest_ns = 0

    def stamp(due_ns):
        nonlocal newest_ns
        late_ns = draw.expovariate(1 / 35e6) if draw.random() < 0.05 else draw.uniform(0, 4e6)
        newest_ns = max(due_ns + round(late_ns), newest_ns + 1_000)
        return newest_ns

    one.card.stamp = stamp
    one.run(SECONDS)
    assert is_true(one)
    assert one.truly_missing == []
    assert len(one.uncertain) <= 16


@EVERY_CARD
def test_one_stamp_that_is_late_by_35_ms_moves_nothing(play, card):
    one, stamped = play(card), []

    def stamp(due_ns):
        stamped.append(due_ns)
        return due_ns + (35_000_000 if len(stamped) == 50 else 0)

    one.card.stamp = stamp
    assert is_true(one.run(SECONDS), lost=0)


@EVERY_CARD
@pytest.mark.parametrize("held_s", [0.06, 0.1, 0.25])
def test_a_bunch_after_a_stall_of_the_bus_loses_nothing_that_came(play, card, held_s):
    one = play(card, buffers=16)
    begin_ns = one.clock.now_ns() + 2_000_000_000
    one.card.held_ns = begin_ns, begin_ns + round(held_s * 1e9)
    one.card.stamp = lambda due_ns: one.clock.now_ns()  # in software, when the buffer is full
    one.run(SECONDS)
    assert is_true(one)
    assert one.truly_missing == []


@EVERY_CARD
def test_stamps_of_another_clock_are_those_of_the_arrival(play, card):
    one = play(card)
    one.card.stamp_flags = 0
    one.card.lost = {60}
    assert is_true(one.run(SECONDS), lost=2 if card in WOVEN else 1)


@EVERY_CARD
@pytest.mark.parametrize("seed", range(3))
def test_stamps_at_arrival_on_a_busy_computer_are_not_late_for_ever(play, card, seed):
    one, draw = play(card, buffers=16), random.Random(seed)
    one.card.stamp_flags = 0
    one.scheduler.waits_s = lambda passed_s: draw.expovariate(1 / 0.02) if 1.0 < passed_s < 2.0 else 0.0
    one.run(SECONDS)
    assert is_true(one)
    last, number = one.slots[-1], one.camera_numbers[-1]
    assert abs(last.time_ns - number * 20_000_000) <= 20_000_000


@EVERY_CARD
@pytest.mark.parametrize("before_the_wrap", [3, 60])
def test_a_count_that_wraps_is_no_loss(play, card, before_the_wrap):
    one = play(card)
    one.card.first_sequence = 2**32 - before_the_wrap
    one.card.lost = {70}
    one.run(SECONDS)
    assert is_true(one, lost=2 if card in WOVEN else 1)
    assert one.rebases == []


@EVERY_CARD
@pytest.mark.parametrize("goes_on_at", [0, 100_000])
def test_a_count_that_restarts_or_skips_moves_nothing_and_is_told(play, card, goes_on_at):
    one = play(card)
    one.card.first_sequence = 500
    one.card.recounts = {60: goes_on_at}
    one.run(SECONDS)
    assert is_true(one, lost=0)
    trusts_count = one.board.now.stream.counts_losses
    assert one.rebases == ([Rebase.COUNT] if trusts_count else [])


@EVERY_CARD
def test_a_count_that_restarts_beside_a_loss_hides_none(play, card):
    one = play(card)
    one.card.first_sequence = 500
    one.card.recounts, one.card.lost = {60: 0}, {58, 59}
    assert is_true(one.run(SECONDS), lost=4 if card in WOVEN else 2)


@EVERY_CARD
@pytest.mark.parametrize("seconds", [1.0, 2.0, 12.0])
def test_a_program_that_is_stopped_loses_what_the_buffers_could_not_hold(play, card, seconds):
    one = play(card, buffers=8)
    one.scheduler.stops = ((2.0, 2.0 + seconds),)
    one.run(SECONDS + seconds)
    assert is_true(one)
    assert one.uncertain == []
    assert abs(len(one.missing) - (50 * seconds - one.board.now.stream.buffers)) <= 2
    assert one.causes == {"program stopped"}
    assert one.board.standstills.counts == {"program_stopped": 1}
    # A capture that begins a second after the stop knows nothing of it.
    ledger, fields = one.captured_from(3.0 + seconds)
    assert ledger.complete
    assert ledger.total == len(fields) >= 90
    first = fields[0][0]
    assert [number for number, _ in fields] == list(range(first, first + len(fields)))
    assert all(abs(time_ns - number * 20_000_000) < 20_000_000 for number, time_ns in fields)


@pytest.mark.parametrize("late_ms", [25, 35])
def test_one_late_stamp_of_woven_frames_without_a_count_moves_nothing(play, late_ms):
    one, stamped = play("frames of em28xx"), []

    def stamp(due_ns):
        stamped.append(due_ns)
        return due_ns + (late_ms * 1_000_000 if len(stamped) == 50 else 0)

    one.card.stamp = stamp
    one.run(SECONDS)
    assert not one.board.now.stream.counts_losses
    assert is_true(one, lost=0)
    assert one.ledger.complete


@EVERY_CARD
@pytest.mark.parametrize("where", ["while it waits", "in a poll that is in vain", "at work on a field"])
@pytest.mark.parametrize("begin_s", [2.001, 2.013])
def test_a_short_stop_is_told_wherever_it_meets_the_program(play, card, where, begin_s):
    one = play(card, buffers=8)
    one.scheduler.stops = ((begin_s, begin_s + 0.6),)
    one.scheduler.stopped_at_work = where == "at work on a field"
    one.scheduler.polls_in_vain = where == "in a poll that is in vain"
    one.run(SECONDS)
    assert is_true(one)
    assert len(one.missing) >= 10
    assert one.causes == {"program stopped"}
    assert one.board.now.losses == {"computer": len(one.missing)}
    assert one.board.standstills.counts == {"program_stopped": 1}


@EVERY_CARD
def test_a_busy_computer_is_told_from_a_stopped_program(play, card):
    one = play(card, buffers=8)
    one.scheduler.waits_s = lambda passed_s: 1.2 if 2.0 < passed_s < 2.1 else 0.0
    one.run(SECONDS)
    assert is_true(one)
    assert one.causes == {"computer busy"}
    assert "waited 1.2 s for a processor" in one.lost[0].reason
    assert one.board.now.losses == {"computer": len(one.missing)}


@EVERY_CARD
@pytest.mark.parametrize("seed", range(3))
def test_a_program_that_starves_loses_to_a_busy_computer(play, card, seed):
    one, draw = play(card, buffers=8), random.Random(seed)
    one.scheduler.waits_s = lambda passed_s: draw.expovariate(1 / 0.1) if 1.0 < passed_s < 4.0 else 0.0
    one.run(SECONDS)
    assert is_true(one)
    assert one.truly_missing
    assert one.causes == {"computer busy"}


@EVERY_CARD
@pytest.mark.parametrize("seed", range(3))
def test_a_program_that_starves_at_work_loses_to_a_busy_computer(play, card, seed):
    one, draw = play(card, buffers=8), random.Random(seed)
    one.scheduler.waits_at_work_s = lambda passed_s: (
        draw.expovariate(1 / 0.06) if 1.0 < passed_s < 4.0 else 0.0
    )
    one.run(SECONDS)
    assert is_true(one)
    assert one.truly_missing
    assert one.causes == {"computer busy"}


@EVERY_CARD
@pytest.mark.parametrize("call", ["DQBUF", "QBUF", "G_STD"])
def test_a_driver_that_hangs_in_a_call_is_where_to_look(play, card, call):
    one = play(card, buffers=8)
    one.scheduler.hangs = {2.0: (call, 1.2)}
    one.run(SECONDS)
    assert one.scheduler.hangs == {}
    assert is_true(one)
    assert one.causes == {"driver hung"}
    assert one.board.now.losses == {"device": len(one.missing)}
    assert one.board.standstills.counts == {"driver_hung": 1}


def test_a_camera_that_goes_on_in_the_other_phase_is_followed_and_told(play):
    one = play("fields of vivid")
    one.card.turned = 80
    one.run(SECONDS)
    assert is_true(one, lost=0)
    assert one.rebases == [Rebase.PHASE]


@EVERY_CARD
@pytest.mark.parametrize("by_s", [3600.0, -3600.0, 0.5, -0.5, 0.06])
def test_a_clock_that_is_set_moves_no_number_and_no_time(play, card, by_s):
    one = play(card)
    begin_ns = one.clock.now_ns() + 3_000_000_000
    one.card.stamp = lambda due_ns: due_ns + (round(by_s * 1e9) if due_ns > begin_ns else 0)
    one.run(SECONDS + 1)
    assert is_true(one)
    assert one.truly_missing == []
    assert Rebase.CLOCK in one.rebases or one.uncertain


@EVERY_CARD
@pytest.mark.parametrize("by_s", [3600.0, -0.5])
def test_a_loss_at_the_instant_of_a_change_of_clock_is_in_the_account(play, card, by_s):
    one = play(card)
    begin_ns = one.clock.now_ns() + 3_000_000_000
    one.card.stamp = lambda due_ns: due_ns + (round(by_s * 1e9) if due_ns > begin_ns else 0)
    unit = 75 if card in WOVEN else 150
    one.card.lost = {unit - 1, unit, unit + 1}
    one.run(SECONDS + 1)
    assert is_true(one)
    assert len(one.truly_missing) == (6 if card in WOVEN else 3)


def test_woven_frames_without_a_count_are_numbered_by_their_stamps(play):
    one, draw = play("frames of em28xx"), random.Random(5)
    one.card.uncounted = one.card.lost = {30, 31, 50, 90}
    one.card.stamp = lambda due_ns: due_ns + round(draw.uniform(0, 8e6))
    assert is_true(one.run(SECONDS), lost=8)


@EVERY_CARD
@pytest.mark.parametrize("seed", [*range(5), 100, 101, 127])
def test_all_of_it_at_once_is_true_or_uncertain_by_enough(play, card, seed):
    one, draw = play(card, buffers=draw_buffers(seed)), random.Random(seed)
    begin_ns = one.clock.now_ns()
    one.card.lost = {draw.randint(20, 200) for _ in range(4)}
    one.card.uncounted = {unit for unit in one.card.lost if draw.random() < 0.5}
    one.card.recounts = {draw.randint(30, 150): draw.choice([0, 7_000])}
    set_ns, by_ns = begin_ns + draw.randint(2, 4) * 10**9, draw.choice([0, 3_600 * 10**9, -(10**9) // 2])
    one.card.stamp = lambda due_ns: due_ns + round(draw.uniform(0, 6e6)) + (by_ns if due_ns > set_ns else 0)
    one.scheduler.stops = ((3.0, 3.0 + draw.choice([0.1, 0.4, 2.0])),)
    one.scheduler.waits_s = lambda passed_s: draw.expovariate(1 / 0.03) if 4.0 < passed_s < 5.0 else 0.0
    one.run(SECONDS + 4)
    assert is_true(one)


def draw_buffers(seed):
    return (8, 12, 16)[seed % 3]


def test_the_model_stamps_in_the_clock_that_it_says(play):
    assert play("fields of bttv").card.stamp_flags == abi.BUF_FLAG_TIMESTAMP_MONOTONIC
