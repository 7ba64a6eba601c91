"""MQTT topics of analyses and guided tests, and the messages on them."""

from collections.abc import Iterable
from typing import Protocol, cast

from grabberd.documents.devices import DeviceDocument
from grabberd.documents.document import Document, assembled
from grabberd.documents.mqtt import DeviceTopic, Topic
from grabberd_liner.analyses.documents import AnalysisState, DeviceAnalysis, QuantityDocument
from grabberd_liner.guided_tests.documents import CheckVerdict, DeviceTest, LinerTestKind


class LinerFields(Protocol):
    """Fields that the liner science adds to a device's document."""

    latest_analysis: DeviceAnalysis | None
    latest_test: DeviceTest | None


class MeasuredValue(Document):
    """A value with its standard deviation, in the same unit."""

    value: float | None
    sigma: float | None
    unit: str


class AnalysisMessage(Document):
    """The analysis that ended last of those of a device's captures."""

    device: str
    capture_id: str
    state: AnalysisState
    analysis: int | None
    created_utc: str | None
    quantities: dict[str, MeasuredValue]
    problem: str | None
    hint: str | None


class LinerTestMessage(Document):
    """The guided test that ended last of those of a device's captures."""

    device: str
    capture_id: str
    state: AnalysisState
    test: str | None
    kind: LinerTestKind | None
    liner: str | None
    verdict: CheckVerdict | None
    created_utc: str | None
    quantities: dict[str, MeasuredValue]
    offers: bool
    problem: str | None
    hint: str | None


def device_analysis(device: str, latest: DeviceAnalysis) -> AnalysisMessage:
    """The latest analysis of a device: its main quantities by name, or why there are none."""
    return assembled(
        AnalysisMessage,
        latest,
        device=device,
        capture_id=latest.capture,
        quantities=_by_name(latest.quantities),
        problem=latest.problem.message if latest.problem else None,
        hint=latest.problem.hint if latest.problem else None,
    )


def device_test(device: str, latest: DeviceTest) -> LinerTestMessage:
    """The latest guided test of a device: its verdict and quantities, or why there are none."""
    test, problem = latest.test, latest.problem
    return LinerTestMessage(
        device=device,
        capture_id=latest.capture,
        state=latest.state,
        test=test and test.id,
        kind=test and test.kind,
        liner=test and test.liner,
        verdict=test and test.verdict,
        created_utc=test and test.created_utc,
        quantities=_by_name(test.quantities if test else ()),
        offers=test is not None and test.offers,
        problem=problem and problem.message,
        hint=problem and problem.hint,
    )


def _by_name(quantities: Iterable[QuantityDocument]) -> dict[str, MeasuredValue]:
    """Quantities that were found."""
    return {one.name: assembled(MeasuredValue, one) for one in quantities if one.value is not None}


def _analysis_of(device: DeviceDocument) -> AnalysisMessage | None:
    latest = cast("LinerFields", device).latest_analysis
    return None if latest is None else device_analysis(device.name, latest)


def _test_of(device: DeviceDocument) -> LinerTestMessage | None:
    latest = cast("LinerFields", device).latest_test
    return None if latest is None else device_test(device.name, latest)


_ANALYSIS = Topic(
    "devices/{device}/analysis", True, "the analysis of one of the device's captures that ended last"
)
_TEST = Topic(
    "devices/{device}/test", True, "the guided test of one of the device's captures that ended last"
)
DEVICE_TOPICS = (DeviceTopic(_ANALYSIS, _analysis_of), DeviceTopic(_TEST, _test_of))
