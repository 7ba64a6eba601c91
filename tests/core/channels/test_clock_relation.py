"""A logger's clock, found from when its readings arrived."""

from collections.abc import Iterable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from core.channels.delays import START_NS, Packet, packets
from grabberd.core.channels import Anomaly, ClockRelation
from grabberd.core.channels.dating import CLOCK_JUMPED
from grabberd.errors import StreamFailed


class Run:
    """Readings dated by one relation: errors in ms, σ in ms, and the anomalies."""

    def __init__(self, made: Iterable[Packet], relation: ClockRelation | None = None) -> None:
        self.relation = relation or ClockRelation()
        errors, sigmas, taken, self.anomalies, times = [], [], [], list[Anomaly](), []
        for packet in made:
            dated = self.relation.date(packet.own_ns, packet.arrival_ns)
            times.append(dated.time_ns)
            errors.append((dated.time_ns - packet.taken_ns) / 1e6)
            sigmas.append(np.full(len(packet.own_ns), dated.sigma_ns / 1e6))
            taken.append((packet.taken_ns - START_NS) / 1e9)
            self.anomalies += dated.anomalies
        self.error_ms, self.sigma_ms = np.concatenate(errors), np.concatenate(sigmas)
        self.taken_s, self.time_ns = np.concatenate(taken), np.concatenate(times)

    def after(self, seconds: float) -> np.ndarray:
        return self.error_ms[self.taken_s >= seconds]


def later(
    made: Iterable[Packet], from_s: float, *, own_s: float = 0.0, arrival_s: float = 0.0
) -> Iterable[Packet]:
    """The same with the logger's clock set, or the computer late, from some time on."""
    for packet in made:
        hit = packet.taken_ns[0] >= START_NS + from_s * 1e9
        own_ns = packet.own_ns + (round(own_s * 1e9) if hit else 0)
        yield Packet(packet.taken_ns, own_ns, packet.arrival_ns + (round(arrival_s * 1e9) if hit else 0))


@pytest.mark.parametrize("drift", [0.0, 5e-5, -1e-3, 8e-3])
def test_packets_of_16_ms_leave_a_tenth_of_a_millisecond(drift: float) -> None:
    run = Run(packets(90, drift=drift))
    late = run.after(30)
    assert late.std() < 0.15
    assert 2.0 - 0.3 < late.mean() < 2.0 + 1.0  # the shortest way is 2 ms
    assert run.relation.drift == pytest.approx(drift / (1 - drift), abs=5e-6)
    assert run.anomalies == []


@pytest.mark.parametrize("rate_hz", [125.0, 1000.0])
@pytest.mark.parametrize("packet_s", [0.0, 0.001, 0.016])
def test_its_sigma_holds(rate_hz: float, packet_s: float) -> None:
    normed = []
    for seed in range(3 if rate_hz < 1000 else 1):  # readings enough, at a second's work for every thousand
        run = Run(packets(25, rate_hz=rate_hz, packet_s=packet_s, seed=seed))
        shortest_ms = run.after(20).mean()  # what is the same for all readings is not part of it
        normed.append((run.error_ms - shortest_ms) / run.sigma_ms)
    chi = np.concatenate(normed)
    assert np.mean(np.abs(chi) < 2) > 0.95
    assert np.sqrt(np.mean(chi**2)) > 0.02


@given(
    st.integers(0, 10_000),
    st.floats(20, 1000),
    st.sampled_from([0.0, 0.001, 0.016, 0.1]),
    st.floats(0, 0.05),
    st.floats(-0.01, 0.01),
)
@settings(max_examples=30, deadline=None)
def test_times_ascend_and_no_reading_is_dated_after_its_arrival(
    seed: int, rate_hz: float, packet_s: float, late_s: float, drift: float
) -> None:
    relation, before_ns = ClockRelation(), 0
    for packet in packets(6, rate_hz=rate_hz, packet_s=packet_s, late_s=late_s, drift=drift, seed=seed):
        dated = relation.date(packet.own_ns, packet.arrival_ns)
        assert dated.time_ns[0] > before_ns
        assert (np.diff(dated.time_ns) > 0).all()
        before_ns = int(dated.time_ns[-1])
        assert before_ns <= packet.arrival_ns + 1_000
        assert dated.sigma_ns > 0


@pytest.mark.parametrize("by_s", [0.05, 0.5, 3600.0, -0.5, -3600.0])
def test_a_clock_that_is_set_is_named_once_and_readings_stay_in_time(by_s: float) -> None:
    run = Run(later(packets(40), 20, own_s=by_s))
    (anomaly,) = run.anomalies
    assert anomaly.reason == CLOCK_JUMPED
    assert float(anomaly.example.split()[0]) == pytest.approx(by_s, abs=0.02)
    assert np.abs(run.after(30) - run.error_ms[run.taken_s < 20][-1]).max() < 3


def test_a_clock_set_back_by_less_than_a_packet_is_noticed_within_seconds() -> None:
    run = Run(later(packets(60, packet_s=0.0), 30, own_s=-0.02))
    assert [anomaly.reason for anomaly in run.anomalies] == [CLOCK_JUMPED]
    assert np.abs(run.after(45) - 2).max() < 1.5


def test_sigma_grows_again_after_a_jump() -> None:
    run = Run(later(packets(40), 20, own_s=5.0))
    just_after = run.sigma_ms[(run.taken_s >= 20) & (run.taken_s < 20.05)]
    assert just_after.max() > 10 * run.sigma_ms[run.taken_s < 20][-1]


def test_a_computer_that_stalls_for_some_seconds_is_no_jump() -> None:
    stalled = [
        packet._replace(arrival_ns=max(packet.arrival_ns, START_NS + 22_000_000_000))
        if packet.taken_ns[0] >= START_NS + 20_000_000_000
        else packet
        for packet in packets(40)
    ]
    run = Run(stalled)
    assert run.anomalies == []
    assert np.abs(run.after(19) - run.error_ms[run.taken_s < 19][-1]).max() < 0.5


def test_after_minutes_of_silence_it_begins_anew_with_the_drift_that_it_knows() -> None:
    made = [
        one for one in packets(400, rate_hz=50) if not START_NS + 60e9 < one.taken_ns[0] < START_NS + 360e9
    ]
    run = Run(made)
    assert run.anomalies == []
    assert np.abs(run.after(365) - 2).max() < 4


def test_a_resolution_of_milliseconds_is_part_of_sigma() -> None:
    made = [one._replace(own_ns=one.own_ns // 1_000_000 * 1_000_000) for one in packets(20, rate_hz=100)]
    run = Run(made, ClockRelation(resolution_ns=1e6))
    assert run.sigma_ms.min() >= 0.28


def test_a_time_in_another_unit_is_refused_with_advice() -> None:
    wrong = (one._replace(own_ns=one.own_ns * 1000) for one in packets(20, packet_s=0.0))
    with pytest.raises(StreamFailed, match=r"1e.03 times as fast") as caught:
        Run(wrong)
    assert "unit" in caught.value.hint
