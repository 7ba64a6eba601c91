"""Captures of several devices begin at the same moment, all of them or none."""

import threading
from collections.abc import Callable
from pathlib import Path
from threading import Thread
from typing import Any

import pytest
from running import PATIENCE_S
from several import UNPLUGGED, sealed_all, several, wait_until_they_accept

from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.capture.schema import create
from grabberd.archive.catalogue.disk_guard import GB, DiskGuard, bytes_per_field
from grabberd.config import LocationConfig, load_config, shipped_configs
from grabberd.errors import CaptureRunning, Conflict, GroupRefused, NotFound, NotReady, StorageError
from grabberd.instrument.acquisition import Ring
from grabberd.instrument.capture.capture_request import CaptureRequest
from grabberd.instrument.capture.capture_start import CaptureStart
from grabberd.instrument.setup import set_up
from grabberd.server.daemon.service import Service

TWO: dict[str, Any] = {"left": {}, "right": {"seed": 2}}
PACED: dict[str, Any] = {"left": {"pace": "real"}, "right": {"pace": "real", "seed": 2}}
FIELDS = CaptureRequest(fields=10)


def both(request: CaptureRequest) -> dict[str, CaptureRequest]:
    return {"left": request, "right": request}


def parts(service: Service) -> list[Path]:
    return sorted(service.archive.directory.glob("*.grab*"))


def test_a_group_has_a_whole_capture_of_each_device(tmp_path: Path) -> None:
    with several(tmp_path, TWO) as service:
        group_id = service.capture_control.start_group(both(FIELDS))
        files = sealed_all(service)
        assert {name: file.stem for name, file in files.items()} == {
            "left": f"{group_id}-left",
            "right": f"{group_id}-right",
        }
        for document in service.capture_control.captures_of(group_id):
            assert (document.verdict, document.fields) == ("complete", 10)


def test_every_file_of_a_group_says_the_same_start_by_both_clocks(tmp_path: Path) -> None:
    with several(tmp_path, TWO) as service:
        group_id = service.capture_control.start_group(both(FIELDS))
        metas = []
        for file in sealed_all(service).values():
            with CaptureReader(file) as reader:
                metas.append(reader.meta)
    groups = [meta.extra["group"] for meta in metas]
    assert groups[0] == groups[1]
    assert (groups[0]["id"], groups[0]["devices"]) == (group_id, ["left", "right"])
    for meta in metas:
        assert (meta.start_ns, meta.created_utc) == (groups[0]["start_ns"], groups[0]["start_utc"])


def test_a_capture_made_alone_is_of_no_group(tmp_path: Path) -> None:
    with several(tmp_path, TWO) as service:
        capture_id = service.capture_control.start("left", FIELDS).id
        sealed_all(service)
        assert service.archive.document(capture_id).group is None
        with pytest.raises(NotFound):
            service.capture_control.captures_of(capture_id.removesuffix("-left"))


def test_fields_of_a_group_can_be_laid_on_one_axis(tmp_path: Path) -> None:
    with several(tmp_path, PACED) as service:
        group_id = service.capture_control.start_group(both(CaptureRequest(fields=30, pre_trigger_fields=5)))
        files = sealed_all(service)
        documents = {one.device: one for one in service.capture_control.captures_of(group_id)}
        for name, file in files.items():
            with CaptureReader(file) as reader:
                first_ns, start_ns = reader.first_time_ns, reader.meta.start_ns
            assert first_ns is not None
            assert documents[name].first_field_s == (first_ns - start_ns) / 1e9
            assert -0.2 < documents[name].first_field_s < 0.1


def test_no_capture_begins_if_one_cannot(tmp_path: Path) -> None:
    with several(tmp_path, {**TWO, "broken": UNPLUGGED}, "left", "right") as service:
        with pytest.raises(GroupRefused) as refused:
            service.capture_control.start_group({**both(FIELDS), "broken": FIELDS})
        assert list(refused.value.refusals) == ["broken"]
        assert isinstance(refused.value.refusals["broken"], NotReady)
        assert "broken" in refused.value.message
        assert parts(service) == []
        service.capture_control.start_group(both(FIELDS))
        assert len(sealed_all(service)) == 2


def test_the_one_that_runs_is_named_and_runs_on(tmp_path: Path) -> None:
    with several(tmp_path, PACED) as service:
        running = service.capture_control.start("right", CaptureRequest()).id
        with pytest.raises(GroupRefused) as refused:
            service.capture_control.start_group(both(FIELDS))
        (error,) = refused.value.refusals.values()
        assert isinstance(error, CaptureRunning)
        assert error.capture_id == running
        assert service.instrument("left").captures.recording is None
        service.capture_control.stop(running)
        sealed_all(service)


def refuse_files_of(device: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Has the disk refuse the capture files of a device."""

    def refusing(path: Path, *limits: int | None) -> object:
        if device in path.name:
            raise StorageError("the disk says no", "replace it")
        return create(path, *limits)

    monkeypatch.setattr("grabberd.archive.capture.schema.create", refusing)


def test_a_file_that_cannot_be_made_leaves_none_of_the_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with several(tmp_path, TWO) as service:
        with monkeypatch.context() as broken:
            refuse_files_of("right", broken)
            with pytest.raises(GroupRefused, match="right: the disk says no"):
                service.capture_control.start_group(both(FIELDS))
        assert parts(service) == []
        service.capture_control.start_group(both(FIELDS))
        assert len(sealed_all(service)) == 2


def thresholds_held(service: Service) -> set[str]:
    return {name for name, one in service.instruments.items() if one.pipeline.thresholds.held}


def test_thresholds_follow_the_light_again_after_a_start_that_failed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with several(tmp_path, TWO) as service:
        refuse_files_of("right", monkeypatch)
        with pytest.raises(GroupRefused):
            service.capture_control.start_group(both(FIELDS))
        assert thresholds_held(service) == set()
        with pytest.raises(StorageError):
            service.capture_control.start("right", FIELDS)
        assert thresholds_held(service) == set()


def test_nothing_records_after_a_start_that_failed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with several(tmp_path, TWO) as service:
        refuse_files_of("right", monkeypatch)
        with pytest.raises(GroupRefused):
            service.capture_control.start_group(both(CaptureRequest()))
        for thread in threading.enumerate():
            if thread.name.startswith("recorder-"):
                thread.join(PATIENCE_S)
                assert not thread.is_alive()


def test_thresholds_follow_the_light_again_after_arming_that_failed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(bits: int | None, lines: str | None) -> Ring:
        raise NotReady("the ring says no", "try again")

    with several(tmp_path, TWO) as service:
        monkeypatch.setattr(service.instrument("right").pipeline, "configure_ring", refuse)
        with pytest.raises(GroupRefused, match="the ring says no"):
            service.capture_control.arm_group(both(FIELDS))
        assert thresholds_held(service) == set()
        assert all(one.captures.armed is None for one in service.instruments.values())


def test_thresholds_stay_held_after_a_trigger_that_failed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with several(tmp_path, TWO) as service:
        group_id = service.capture_control.arm_group(both(FIELDS))
        with monkeypatch.context() as broken:
            refuse_files_of("right", broken)
            with pytest.raises(GroupRefused):
                service.capture_control.trigger_group(group_id)
        assert thresholds_held(service) == {"left", "right"}
        assert parts(service) == []
        service.capture_control.trigger_group(group_id)
        assert len(sealed_all(service)) == 2


def test_the_disk_has_to_have_room_for_all_of_them(tmp_path: Path) -> None:
    wanted = CaptureRequest(fields=4400, bits=8)
    room = 1.5 * 60 * 50 * bytes_per_field(8, 288, 720)
    with several(tmp_path, PACED, disk=DiskGuard(GB, lambda _: round(GB + room))) as service:
        with pytest.raises(StorageError, match=r"room for 0\.[78] minutes .* 1\.5 are needed"):
            service.capture_control.start_group(both(wanted))
        assert parts(service) == []
        running = service.capture_control.start("left", wanted).id
        with pytest.raises(StorageError, match=r"room for 0\.[78] minutes .* 1\.5 are needed"):
            service.capture_control.start("right", wanted)
        service.capture_control.stop(running)
        sealed_all(service)


def test_armed_captures_begin_with_one_trigger(tmp_path: Path) -> None:
    with several(tmp_path, PACED) as service:
        group_id = service.capture_control.arm_group(both(CaptureRequest(fields=10)))
        documents = service.capture_control.captures_of(group_id)
        assert [one.state for one in documents] == ["armed", "armed"]
        assert documents[0].group.start_utc is None
        service.capture_control.trigger_group(group_id)
        starts = set()
        for file in sealed_all(service).values():
            with CaptureReader(file) as reader:
                starts.add(reader.meta.start_ns)
                assert reader.ledger.received == 10
        assert len(starts) == 1
        with pytest.raises(Conflict):
            service.capture_control.trigger_group(group_id)


def meanwhile(step: str, device: str, act: Callable[[str], None], patch: pytest.MonkeyPatch) -> list[Thread]:
    """Another request for the group that arrives before a step is performed for one of its devices."""
    performed = getattr(CaptureStart, step)
    threads: list[Thread] = []

    def interrupted(one: CaptureStart, *args: object) -> object:
        if one.device.name == device and one.new.group:
            threads.append(Thread(target=act, args=(one.new.group.id,), daemon=True))
            threads[-1].start()
            threads[-1].join(0.2)  # long enough for it to look at the half-made group
        return performed(one, *args)

    patch.setattr(CaptureStart, step, interrupted)
    return threads


def test_a_trigger_waits_until_the_whole_group_is_armed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with several(tmp_path, TWO) as service:
        requests = meanwhile("arm", "right", service.capture_control.trigger_group, monkeypatch)
        service.capture_control.arm_group(both(CaptureRequest(fields=5)))
        requests[0].join(PATIENCE_S)
        assert len(sealed_all(service)) == 2


def test_a_stop_waits_until_the_whole_group_has_started(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with several(tmp_path, PACED) as service:
        requests = meanwhile("begin", "right", service.capture_control.stop_group, monkeypatch)
        service.capture_control.start_group(both(CaptureRequest()))
        requests[0].join(PATIENCE_S)
        assert len(sealed_all(service)) == 2


def test_the_trigger_of_one_is_that_of_its_group(tmp_path: Path) -> None:
    with several(tmp_path, TWO) as service:
        group_id = service.capture_control.arm_group(both(CaptureRequest(fields=5)))
        service.capture_control.trigger(f"{group_id}-right")
        assert len(sealed_all(service)) == 2


def test_one_that_was_taken_away_is_not_triggered_with_the_others(tmp_path: Path) -> None:
    with several(tmp_path, TWO) as service:
        group_id = service.capture_control.arm_group(both(CaptureRequest(fields=5)))
        service.capture_control.stop(f"{group_id}-left")
        service.capture_control.trigger_group(group_id)
        (file,) = sealed_all(service).values()
        with CaptureReader(file) as reader:
            assert reader.meta.extra["group"]["devices"] == ["right"]


def test_a_group_is_stopped_at_once(tmp_path: Path) -> None:
    with several(tmp_path, PACED) as service:
        group_id = service.capture_control.start_group(both(CaptureRequest()))
        service.capture_control.stop_group(group_id)
        sealed_all(service)
        reasons = {one.ended_because for one in service.capture_control.captures_of(group_id)}
        assert reasons == {"stopped by the operator"}
        with pytest.raises(Conflict):
            service.capture_control.stop_group(group_id)
        with pytest.raises(NotFound):
            service.capture_control.stop_group("20200101T000000000Z")


def test_stopping_an_armed_group_leaves_nothing(tmp_path: Path) -> None:
    with several(tmp_path, TWO) as service:
        group_id = service.capture_control.arm_group(both(FIELDS))
        service.capture_control.stop_group(group_id)
        assert all(one.captures.armed is None for one in service.instruments.values())
        assert thresholds_held(service) == set()
        with pytest.raises(NotFound):
            service.capture_control.captures_of(group_id)
        service.capture_control.start_group(both(FIELDS))
        sealed_all(service)


def test_a_group_is_found_again_after_a_restart_and_without_the_ones_deleted(tmp_path: Path) -> None:
    with several(tmp_path, TWO) as service:
        group_id = service.capture_control.start_group(both(FIELDS))
        sealed_all(service)
    with several(tmp_path, {"right": {}}) as service:  # the other is configured no more
        found = service.capture_control.captures_of(group_id)
        assert sorted(one.device for one in found) == ["left", "right"]
        service.annotations.delete(f"{group_id}-right")
        assert [one.device for one in service.capture_control.captures_of(group_id)] == ["left"]
        group = service.capture_control.group_document(group_id)
        assert (group.id, [one.device for one in group.captures]) == (group_id, ["left"])


def test_orders_of_two_people_at_once_do_not_wait_for_each_other_for_ever(tmp_path: Path) -> None:
    with several(tmp_path, TWO) as service:
        outcomes: list[object] = []

        def order(names: tuple[str, str]) -> None:
            try:
                outcomes.append(
                    service.capture_control.start_group({name: CaptureRequest() for name in names})
                )
            except GroupRefused as refusal:
                outcomes.append(refusal)

        threads = [
            threading.Thread(target=order, args=(names,)) for names in (("left", "right"), ("right", "left"))
        ]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(PATIENCE_S)
        assert sorted(type(outcome).__name__ for outcome in outcomes) == ["GroupRefused", "str"]
        service.capture_control.stop_group(next(one for one in outcomes if isinstance(one, str)))
        sealed_all(service)


class NotedLock:
    """A lock that notes when it is taken."""

    def __init__(self, name: str, taken: list[str]) -> None:
        self._name, self._taken = name, taken

    def __enter__(self) -> None:
        self._taken.append(self._name)

    def __exit__(self, *_: object) -> None:
        pass


def test_locks_are_taken_in_one_order_whatever_the_order_of_the_request(tmp_path: Path) -> None:
    with several(tmp_path, TWO) as service:
        taken: list[str] = []
        for name, one in service.instruments.items():
            one.captures.lock = NotedLock(name, taken)  # type: ignore[assignment]
        service.capture_control.start_group({"right": FIELDS, "left": FIELDS})
        assert taken == ["left", "right"]
        sealed_all(service)


def test_a_device_that_there_is_not_is_named_with_those_there_are(tmp_path: Path) -> None:
    with several(tmp_path, TWO) as service, pytest.raises(NotFound, match="middle") as refused:
        service.capture_control.start_group({"left": FIELDS, "middle": FIELDS})
    assert "left, right" in refused.value.hint


def test_the_shipped_example_of_four_captures_together(tmp_path: Path) -> None:
    file = shipped_configs() / "four.yaml"
    config = load_config(file)
    quick = {
        name: device.model_copy(
            update={
                "options": {**device.options, "pace": "free"},
                "location": LocationConfig(method="centroid"),
            }
        )
        for name, device in config.devices.items()
    }
    service = Service(set_up(config.model_copy(update={"devices": quick}), file), tmp_path)
    service.start()
    try:
        wait_until_they_accept(service)
        group_id = service.capture_control.start_group(dict.fromkeys(quick, CaptureRequest(fields=4)))
        sealed_all(service)
        captures = service.capture_control.captures_of(group_id)
        assert [one.device for one in captures] == sorted(config.devices)
        assert {one.verdict for one in captures} == {"complete"}
    finally:
        service.stop()


def test_no_field_is_missed_however_long_the_files_take_to_be_made(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    slots = 2 * 32

    def slowly(path: Path, *limits: int | None) -> object:
        with service.instrument("left").pipeline.ring.reader() as reader:
            for _ in range(slots):  # twice as many as the ring has
                assert reader.take(PATIENCE_S)
        return create(path, *limits)

    with several(tmp_path, PACED) as service:
        monkeypatch.setattr("grabberd.archive.capture.schema.create", slowly)
        service.capture_control.start_group(both(CaptureRequest(fields=slots)))
        for file in sealed_all(service).values():
            with CaptureReader(file) as reader:
                assert reader.ledger.complete, reader.ledger.in_words(50.0)
