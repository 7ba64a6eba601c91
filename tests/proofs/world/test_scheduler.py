"""The simulated runtime: one thread at a time, by a seed, in simulated time."""

import pytest
from tests.proofs.world.scheduler import START_NS, Scheduler
from tests.proofs.world.waiting import Deadlock

from grabberd import runtime


def simulated(seed, main):
    scheduler = Scheduler(seed, switch_every=2.0)
    with runtime.installed(scheduler):
        scheduler.run(lambda: main(scheduler))
    return scheduler


def test_an_hour_takes_no_time():
    def main(scheduler):
        runtime.sleep(3600.0)

    assert simulated(1, main).now_ns == START_NS + 3600 * 10**9


def test_time_jumps_to_whoever_waits_for_the_next_moment():
    woken = []

    def main(scheduler):
        for seconds in (3.0, 1.0, 2.0):
            runtime.Timer(seconds, lambda seconds=seconds: woken.append((seconds, scheduler.now_ns))).start()
        runtime.sleep(5.0)

    simulated(1, main)
    assert [round((ns - START_NS) / 1e9, 3) for _, ns in woken] == [1.0, 2.0, 3.0]


def counting(threads):
    """Threads that count without a lock: some counts are lost, which depends on the seed."""
    found = {}

    def main(scheduler):
        count, meeting = [0], runtime.lock()

        def add():
            for _ in range(20):
                before = count[0]
                with meeting:
                    pass
                count[0] = before + 1

        made = [runtime.Thread(target=add) for _ in range(threads)]
        for one in made:
            one.start()
        for one in made:
            one.join()
        found["count"] = count[0]

    return main, found


def played(seed):
    main, found = counting(3)
    scheduler = simulated(seed, main)
    return scheduler.trace, scheduler.switches, found["count"]


def test_a_seed_plays_again_to_the_letter():
    assert [played(seed) for seed in range(20)] == [played(seed) for seed in range(20)]


def test_seeds_differ_and_find_a_race():
    runs = [played(seed) for seed in range(20)]
    assert len({trace for trace, _, _ in runs}) == 20
    assert any(count < 60 for _, _, count in runs)


def test_locks_in_opposite_orders_are_found_by_some_seed():
    def main(scheduler):
        one, other = runtime.lock(), runtime.lock()

        def both(first, second):
            with first, second:
                pass

        threads = [runtime.Thread(target=both, args=order) for order in ((one, other), (other, one))]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()

    def deadlocks(seed):
        try:
            simulated(seed, main)
        except Deadlock as error:
            return str(error)
        return ""

    found = [text for seed in range(50) if (text := deadlocks(seed))]
    assert found
    assert all("with first, second" in text for text in found)


def test_who_waits_for_nobody_is_found():
    with pytest.raises(Deadlock, match=r"runtime\.event\(\)\.wait\(\)"):
        simulated(1, lambda scheduler: runtime.event().wait())


def test_a_condition_gives_its_lock_away_and_comes_back_with_it():
    def main(scheduler):
        changed, items = runtime.condition(), []

        def put():
            with changed:
                items.append(1)
                changed.notify_all()

        with changed, changed:
            runtime.Thread(target=put).start()
            assert changed.wait_for(lambda: items, 10.0)
        with changed:
            assert not changed.wait(1.0)

    simulated(3, main)


def test_a_queue_waits_in_simulated_time():
    def main(scheduler):
        items = runtime.simple_queue()
        runtime.Timer(2.0, lambda: items.put("late")).start()
        with pytest.raises(runtime.Empty):
            items.get(timeout=1.0)
        assert items.get() == "late"

    assert simulated(4, main).now_ns >= START_NS + 2 * 10**9


def test_a_killed_thread_runs_its_way_out_and_no_further():
    done = []

    def main(scheduler):
        lock = runtime.lock()

        def work():
            try:
                with lock:
                    runtime.sleep(100.0)
                    done.append("on")
            finally:
                done.append("out")

        task = scheduler.spawn(work, "work", is_daemons=True)
        runtime.sleep(1.0)
        scheduler.kill([task])
        assert task.ended

    simulated(5, main)
    assert done == ["out"]


def test_a_busy_computer_lets_the_daemons_threads_wait():
    def main(scheduler):
        def work():
            runtime.sleep(1.0)
            late.append(scheduler.now_ns - START_NS)

        late = []
        scheduler.lateness_ns = lambda name: 50_000_000 if name == "work" else 0
        scheduler.spawn(work, "work", is_daemons=True)
        runtime.sleep(2.0)
        assert 1_100_000_000 <= late[0] < 1_110_000_000

    simulated(6, main)


def test_a_pool_works_calls_off():
    def main(scheduler):
        def slow(seconds):
            runtime.sleep(seconds)
            return seconds

        with runtime.pool(2, "two") as pool:
            assert list(pool.map(slow, [3.0, 1.0])) == [3.0, 1.0]

    assert simulated(7, main).now_ns >= START_NS + 3 * 10**9


def test_an_error_of_a_thread_is_the_worlds():
    def main(scheduler):
        runtime.Thread(target=lambda: 1 / 0).start()
        runtime.sleep(1.0)

    with pytest.raises(ZeroDivisionError):
        simulated(8, main)
