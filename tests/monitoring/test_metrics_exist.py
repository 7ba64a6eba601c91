"""Whatever rules and dashboard ask for is there: metrics, labels and their values, in a running daemon."""

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from fastapi.testclient import TestClient
from prometheus_client.parser import text_string_to_metric_families
from running import configuration, wait_until_it_accepts

from grabberd.config import MqttConfig, default_config_file
from grabberd.instrument.channels.logger_setup import set_up_loggers
from grabberd.instrument.setup import set_up
from grabberd.server.api import create_app
from grabberd.server.daemon.service import Service
from monitoring.promtool import DASHBOARD, check_queries, needs_promtool, rules

_SELECTOR = re.compile(r"\b(up|(?:grabberd|process)_\w+)(?:\{([^}]*)\})?")
_MATCHER = re.compile(r'(\w+)\s*(=~|=)\s*"([^"]*)"')
_VARIABLE = re.compile(r"\$(?!__)\w+")
_OF_PROMETHEUS = ("job", "instance")


class Selector(NamedTuple):
    """A metric that a query names, with what it asks of its labels."""

    name: str
    labels: tuple[tuple[str, tuple[str, ...]], ...]


def dashboard() -> dict[str, Any]:
    return json.loads(DASHBOARD.read_text())


def panels() -> list[dict[str, Any]]:
    return [panel for panel in dashboard()["panels"] if panel["type"] != "row"]


def panel_queries() -> list[str]:
    return [target["expr"] for panel in panels() for target in panel["targets"]]


def selectors(query: str) -> Iterator[Selector]:
    for name, inside in _SELECTOR.findall(query):
        matchers = _MATCHER.findall(inside)
        yield Selector(name, tuple((label, tuple(value.split("|"))) for label, _, value in matchers))


ASKED = sorted(
    {one for query in [rule["expr"] for rule in rules()] + panel_queries() for one in selectors(query)}
)


@pytest.fixture(scope="module")
def samples(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[dict[str, str]]]:
    """Labels of all samples of a daemon with a logger and a broker that is away, by the metrics' names."""
    pytest.importorskip("aiomqtt", reason="pip install 'grabberd[mqtt]'")
    config = configuration({"pace": "free"})
    storage = config.storage.model_copy(update={"directory": tmp_path_factory.mktemp("state")})
    more = {"mqtt": MqttConfig(host="127.0.0.1", port=9), "storage": storage, "site": {"barn": "north"}}
    config = config.model_copy(update=more)
    loggers = set_up_loggers(config, default_config_file())
    service = Service.from_config(config, set_up(config, default_config_file()), loggers)
    with TestClient(create_app(service), "http://localhost") as client:
        wait_until_it_accepts(service)
        text = client.get("/metrics").text
    found: dict[str, list[dict[str, str]]] = {"up": []}
    for family in text_string_to_metric_families(text):
        found.setdefault(family.name, [])
        for sample in family.samples:
            found.setdefault(sample.name, []).append(dict(sample.labels))
    return found


@pytest.mark.parametrize("one", ASKED, ids=lambda one: f"{one.name} {dict(one.labels)}")
def test_what_is_asked_for_is_there(one: Selector, samples: dict[str, list[dict[str, str]]]) -> None:
    assert one.name in samples
    for label, values in one.labels:
        if label in _OF_PROMETHEUS or not samples[one.name]:
            continue
        known = {labels.get(label) for labels in samples[one.name]}
        assert known != {None}, label
        assert all(value in known or _VARIABLE.fullmatch(value) for value in values), known


@needs_promtool
def test_prometheus_understands_every_query_of_the_dashboard(tmp_path: Path) -> None:
    plain = [_VARIABLE.sub("x", query.replace("$__rate_interval", "5m")) for query in panel_queries()]
    check_queries(plain, tmp_path)


def test_every_variable_of_a_query_is_one_of_the_dashboards() -> None:
    listed = {variable["name"] for variable in dashboard()["templating"]["list"]}
    assert {name[1:] for query in panel_queries() for name in _VARIABLE.findall(query)} <= listed


def test_panels_are_numbered_and_do_not_overlap() -> None:
    all_panels = dashboard()["panels"]
    assert len({panel["id"] for panel in all_panels}) == len(all_panels)
    taken: set[tuple[int, int]] = set()
    for panel in all_panels:
        at = panel["gridPos"]
        assert at["x"] + at["w"] <= 24, panel["title"]
        cells = {(at["x"] + i, at["y"] + j) for i in range(at["w"]) for j in range(at["h"])}
        assert not cells & taken, panel["title"]
        taken |= cells


def test_every_panel_asks_the_chosen_prometheus_and_can_be_loaded() -> None:
    source = {"type": "prometheus", "uid": "${datasource}"}
    for panel in panels():
        assert panel["datasource"] == source
        assert panel["title"]
        assert panel["type"] in ("stat", "timeseries", "state-timeline")
        assert {"defaults", "overrides"} == set(panel["fieldConfig"])
        assert [target["refId"] for target in panel["targets"]] == ["A", "B"][: len(panel["targets"])]
        assert all(target["datasource"] == source for target in panel["targets"])
    assert (dashboard()["uid"], "id" in dashboard()) == ("grabberd", False)
