"""What is played in months, and in which order."""

from itertools import pairwise

from tests.proofs.faults.playing import FAULTS
from tests.proofs.faults.scenario import all_of

from .plan import ALONE, BESIDE, WARMING, counted, lives, playable


def test_a_seed_gives_the_same_plan_again():
    assert lives(7, 40, 10.0, 16) == lives(7, 40, 10.0, 16)
    assert lives(7, 40, 10.0, 16) != lives(8, 40, 10.0, 16)


def test_every_fault_that_can_be_played_comes_before_any_comes_twice_more_often():
    times = counted(lives(1, 400, 10.0, 16))
    for names in ({one.fault for one in playable()}, BESIDE, ALONE):
        each = [times[name] for name in names]
        assert max(each) - min(each) <= 1


def test_as_many_faults_are_planned_as_were_asked_for():
    assert sum(counted(lives(3, 50, 10.0, 16)).values()) == 50


def test_acts_follow_each_other_in_one_capture_and_the_machine_fails_between_them():
    for life in lives(1, 64, 10.0, 16):
        assert len(life.acts) == len(life.beside)
        begins_s = [act.lead_s for act in life.acts]
        assert begins_s == sorted(begins_s)
        assert all(later - earlier == 20.0 for earlier, later in pairwise(begins_s))


def test_most_faults_of_the_list_are_played_and_the_others_need_a_daemon_of_their_own():
    assert len(BESIDE) + len(ALONE) >= len(FAULTS) - 2
    assert len(playable()) > len(all_of()) / 2


def test_memory_that_is_kept_is_taken_before_growth_is_judged():
    assert all(life.beside[0] == WARMING for life in lives(1, 64, 10.0, 16))
