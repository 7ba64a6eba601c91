"""Every alert rule, held by promtool against series on which it has to fire, and on which it must not."""

import re
from pathlib import Path
from typing import Any, NamedTuple

import pytest
import yaml

from monitoring.promtool import RULES, judged, needs_promtool, rules

BY_NAME = {rule["alert"]: rule for rule in rules()}
OWN = {"job": "grabberd", "instance": "barn"}
NORTH = {**OWN, "device": "north"}
DAY_S = 86_400


class Case(NamedTuple):
    """An alert and its series, a value a minute.

    Attributes:
        alert: Its name.
        firing: Values of each series on which it fires; "10x60" is sixty minutes of ten.
        quiet: Values on which it does not.
        after_min: When it has to fire; a minute less than its `for` it must not.
        labels: Labels that it fires with.
        value: Its value as the summary shows it.
    """

    alert: str
    firing: dict[str, str]
    quiet: dict[str, str]
    after_min: int
    labels: dict[str, str]
    value: str = "1"


def series(name: str, **labels: str) -> str:
    pairs = ",".join(f'{key}="{value}"' for key, value in {**OWN, **labels}.items())
    return f"{name}{{{pairs}}}"


def part(alert: str, name: str, after_min: int, level: str = "bad") -> Case:
    """A part of the health that is not as it should be."""
    labels = {"device": "north", "part": name, "level": level}
    one = series("grabberd_health_part", **labels)
    return Case(alert, {one: "1x30"}, {one: "0x30"}, after_min, {**OWN, **labels})


def simple(
    alert: str, one: str, firing: str, quiet: str, after_min: int, value: str = "1", **labels: str
) -> Case:
    return Case(alert, {one: firing}, {one: quiet}, after_min, {**OWN, **labels}, value)


FIELDS = {
    outcome: series("grabberd_fields_total", device="north", outcome=outcome)
    for outcome in ("received", "lost", "no_signal")
}
READY = series("grabberd_logger_state", logger="vacuum", state="ready")
AGE = series("grabberd_logger_reading_age_seconds", logger="vacuum")
BUCKETS = {
    le: series("grabberd_latency_seconds_bucket", device="north", le=le) for le in ("0.32", "0.64", "+Inf")
}
LEFT = series("grabberd_disk_left_seconds")
CASES = (
    simple("GrabberdDown", series("up"), "0x10", "1x10", 2),
    simple("GrabberdRestarts", series("process_start_time_seconds"), "1 1 2 3 4 4x9", "1 1 2 3 3x9", 10, "3"),
    simple(
        "GrabberdNotReady", series("grabberd_ready", device="north"), "0x10", "0 0 0 1 0x4", 5, device="north"
    ),
    part("GrabberdDeviceAway", "device", 2),
    part("GrabberdNoSignal", "signal", 2),
    Case(
        "GrabberdFieldsLost",
        {FIELDS["lost"]: "0x10 8x10"},
        {FIELDS["lost"]: "0x10 3x10", FIELDS["no_signal"]: "0+3000x20"},
        15,
        NORTH,
        "8",
    ),
    Case(
        "GrabberdFieldsLostConstantly",
        {FIELDS["lost"]: "0+60x20", FIELDS["received"]: "0+2940x20"},
        {FIELDS["lost"]: "0+15x20", FIELDS["received"]: "0+2985x20"},
        12,
        NORTH,
        "2%",
    ),
    simple("GrabberdDiskNearlyFull", LEFT, "3000x20", "3601x20", 10, "50m 0s"),
    simple("GrabberdDiskFull", LEFT, "300x20", "601x20", 1, "5m 0s"),
    simple(
        "GrabberdDiskFullTomorrow",
        series("grabberd_disk_free_bytes"),
        "1000000000-1000000x480",
        "1000000000-100000x480",
        420,
    ),
    Case(
        "GrabberdDiskUnusable",
        {series("grabberd_health_part", device="north", part="disk", level="bad"): "1x20"},
        {series("grabberd_health_part", device="north", part="disk", level="bad"): "1x20", LEFT: "300x20"},
        1,
        {**NORTH, "part": "disk", "level": "bad"},
    ),
    part("GrabberdClock", "clock", 5, "warning"),
    part("GrabberdNoCalibration", "calibration", 10),
    simple(
        "GrabberdCalibrationOld",
        series("grabberd_calibration_age_seconds", device="north"),
        f"{91 * DAY_S}x90",
        f"{89 * DAY_S}x90",
        60,
        "91d 0h 0m 0s",
        device="north",
    ),
    part("GrabberdRigMoved", "rig", 10, "warning"),
    part("GrabberdFieldOrder", "order", 10),
    Case(
        "GrabberdLateMeasuring",
        {BUCKETS["0.32"]: "0+2900x30", BUCKETS["0.64"]: "0+2910x30", BUCKETS["+Inf"]: "0+3000x30"},
        {BUCKETS["0.32"]: "0+3000x30", BUCKETS["0.64"]: "0+3000x30", BUCKETS["+Inf"]: "0+3000x30"},
        15,
        NORTH,
    ),
    simple(
        "GrabberdFault",
        series("grabberd_fault", cause="index_failed"),
        "1x10",
        "0x10",
        5,
        cause="index_failed",
    ),
    simple("GrabberdUnsealedCaptures", series("grabberd_unsealed_captures"), "2x20", "0x20", 15, "2"),
    Case(
        "GrabberdCapturesIncomplete",
        {series("grabberd_captures_total", device="north", verdict="incomplete"): "0x5 1x10"},
        {series("grabberd_captures_total", device="north", verdict="complete"): "0x5 1x10"},
        8,
        {**NORTH, "verdict": "incomplete"},
    ),
    simple("GrabberdLoggerAway", READY, "0x10", "1x10", 5, logger="vacuum", state="ready"),
    Case(
        "GrabberdLoggerSilent",
        {AGE: "30x10", READY: "1x10"},
        {AGE: "30x10", READY: "0x10"},
        2,
        {**OWN, "logger": "vacuum"},
        "30s",
    ),
    simple("GrabberdMqttAway", series("grabberd_mqtt_connected"), "0x20", "1x20", 15),
    simple("GrabberdSummariesMissed", series("grabberd_mqtt_missed_captures_total"), "0x5 1x10", "1x15", 8),
    simple("GrabberdTooManyClients", series("grabberd_descriptors_exhausted_total"), "0x5 1x10", "1x15", 8),
)


def minutes_of(duration: str) -> int:
    number, unit = int(duration[:-1]), duration[-1]
    return number * {"m": 1, "h": 60}[unit]


def expected(case: Case) -> dict[str, Any]:
    """The alert with all of its labels and its summary."""
    rule = BY_NAME[case.alert]
    shown = {f"$labels.{key}": value for key, value in case.labels.items()}
    summary = re.sub(
        r"\{\{ (\S+)[^}]*\}\}",
        lambda found: {**shown, "$value": case.value}[found[1]],
        rule["annotations"]["summary"],
    )
    return {"exp_labels": {**case.labels, **rule["labels"]}, "exp_annotations": {"summary": summary}}


def trial(case: Case, values: dict[str, str], *checks: tuple[int, list[dict[str, Any]]]) -> dict[str, Any]:
    return {
        "interval": "1m",
        "input_series": [{"series": name, "values": said} for name, said in values.items()],
        "alert_rule_test": [
            {"eval_time": f"{at}m", "alertname": case.alert, "exp_alerts": alerts} for at, alerts in checks
        ],
    }


def test_every_alert_is_tested_and_has_a_severity_and_a_remedy() -> None:
    assert [case.alert for case in CASES] == list(BY_NAME)
    for rule in BY_NAME.values():
        assert rule["labels"]["severity"] in ("warning", "critical")
        assert ":" in rule["annotations"]["summary"] or ";" in rule["annotations"]["summary"], rule["alert"]


@needs_promtool
def test_prometheus_accepts_the_rules() -> None:
    judged("check", "rules", RULES)


@needs_promtool
@pytest.mark.parametrize("case", CASES, ids=[case.alert for case in CASES])
def test_an_alert_fires_when_it_has_to_and_only_then(case: Case, tmp_path: Path) -> None:
    waits = minutes_of(BY_NAME[case.alert].get("for", "0m"))
    before = [(waits - 1, list[dict[str, Any]]())] if waits else []
    tests = [
        trial(case, case.firing, *before, (case.after_min, [expected(case)])),
        trial(case, case.quiet, (case.after_min, [])),
    ]
    file = tmp_path / "tests.yaml"
    file.write_text(yaml.safe_dump({"rule_files": [str(RULES)], "tests": tests}))
    judged("test", "rules", file)
