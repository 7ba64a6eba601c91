"""The API's description says of every route what it does, takes and refuses, and shows examples."""

from collections.abc import Iterator
from typing import Any

import pytest
from fastapi.testclient import TestClient

Operation = dict[str, Any]


@pytest.fixture(scope="module")
def description(idle: TestClient) -> dict[str, Any]:
    document: dict[str, Any] = idle.get("/api/v1/openapi.json").json()
    return document


@pytest.fixture(scope="module")
def operations(description: dict[str, Any]) -> list[Operation]:
    return [operation for methods in description["paths"].values() for operation in methods.values()]


def of_fastapi(operation: Operation) -> str:
    """The summary that it makes up of a function's name."""
    name: str = operation["operationId"]
    return name.replace("_", " ").title()


def test_every_route_says_what_it_does(operations: list[Operation]) -> None:
    assert len(operations) > 35
    for operation in operations:
        assert operation["tags"]
        assert operation["summary"] != of_fastapi(operation), operation["operationId"]
        assert operation["description"].endswith((".", "?")), operation["operationId"]


def test_no_two_routes_have_one_name(operations: list[Operation]) -> None:
    for key in ("operationId", "summary"):
        names = [operation[key] for operation in operations]
        assert len(set(names)) == len(names)


def test_every_parameter_says_what_it_means(operations: list[Operation]) -> None:
    silent = [
        f"{operation['operationId']}: {one['name']}"
        for operation in operations
        for one in operation.get("parameters", [])
        if not one.get("description")
    ]
    assert silent == []


def test_every_problem_is_a_problem_document(operations: list[Operation], description: Operation) -> None:
    shared = description["components"]["responses"]
    for operation in operations:
        for status, answer in operation["responses"].items():
            if status < "400" or status == "416":
                continue
            assert set(answer) == {"$ref"} or set(answer["content"]) == {"application/problem+json"}
            if "$ref" in answer:
                assert answer["$ref"].rpartition("/")[2] == f"Problem{status}"
    for answer in shared.values():
        assert answer["description"]
        assert list(answer["content"]) == ["application/problem+json"]


def test_every_answer_has_a_type(operations: list[Operation]) -> None:
    for operation in operations:
        for status, answer in operation["responses"].items():
            if status < "300":
                assert all(one.get("schema") for one in answer.get("content", {}).values()), operation


def test_what_is_taken_has_an_example(operations: list[Operation], description: Operation) -> None:
    taken = {
        name
        for operation in operations
        for content in operation.get("requestBody", {}).get("content", {}).values()
        for name in names_in(content["schema"])
    }
    assert len(taken) >= 6
    assert [name for name in taken if not description["components"]["schemas"][name].get("examples")] == []


def names_in(schema: Operation) -> Iterator[str]:
    if "$ref" in schema:
        yield schema["$ref"].rpartition("/")[2]
    for choice in schema.get("anyOf", ()):
        yield from names_in(choice)


def test_that_a_file_is_damaged_is_said_of_the_routes_that_open_one(description: Operation) -> None:
    damaged = [
        path
        for path, methods in description["paths"].items()
        if any("410" in operation["responses"] for operation in methods.values())
    ]
    points = (f"/points{ending}" for ending in ("", ".csv", ".ply", ".parquet", ".mat", ".c3d"))
    opened = ("/file", "/ledger", "/runs/{run}", *points, "/channels", "/channels.csv", "/fields/{n}.png")
    shown = ("/thumbnail.png", "/widths", "/replay/points", "/replay/pictures")
    assert damaged == [f"/api/v1/captures/{{capture_id}}{one}" for one in (*opened, *shown)]
