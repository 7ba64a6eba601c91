"""Points are taken home in several formats, of any run."""

import csv
import io
import json
import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient

from archive.mat_files import by_matio
from grabberd.archive.export.points_columns import CLOUD_COLUMNS
from grabberd.archive.export.table_files import ply_vertex
from server.api.conftest import sealed, service_in

CAPTURES = "/api/v1/captures"


@pytest.fixture(scope="module")
def measured(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """A client and the address of a capture of 20 fields."""
    from running import wait_until_it_accepts  # noqa: PLC0415

    from grabberd.server.api import create_app  # noqa: PLC0415

    service = service_in(tmp_path_factory.mktemp("measured"), pace="free")
    with TestClient(create_app(service), "http://localhost", raise_server_exceptions=False) as client:
        wait_until_it_accepts(service)
        capture_id = client.post(CAPTURES, json={"fields": 20}).json()["id"]
        sealed(client, capture_id)
        yield client, f"{CAPTURES}/{capture_id}"


def table(client: TestClient, url: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(client.get(f"{url}/points.csv").text)))


def test_a_table_for_decimal_commas_has_the_same_numbers(measured: tuple[TestClient, str]) -> None:
    client, url = measured
    text = client.get(f"{url}/points.csv?separator=semicolon").content.decode("utf-8-sig")
    rows = list(csv.DictReader(io.StringIO(text), delimiter=";"))
    assert [{name: cell.replace(",", ".") for name, cell in row.items()} for row in rows] == table(
        client, url
    )
    assert client.get(f"{url}/channels.csv?separator=semicolon").text.startswith("\ufeffchannel;")
    assert client.get(f"{url}/points.csv?separator=tab").status_code == 422


def test_a_cloud_has_a_vertex_for_every_row_of_the_table(measured: tuple[TestClient, str]) -> None:
    client, url = measured
    answer = client.get(f"{url}/points.ply?run=1")
    assert answer.headers["content-type"] == "application/ply"
    assert answer.headers["content-disposition"].endswith('-points.ply"')
    head, _, body = answer.content.partition(b"end_header\n")
    rows = table(client, url)
    assert f"element vertex {len(rows)}\n".encode() in head
    assert len(body) == len(rows) * ply_vertex(CLOUD_COLUMNS).itemsize


def test_a_cloud_of_one_field_has_its_points_alone(measured: tuple[TestClient, str]) -> None:
    client, url = measured
    answer = client.get(f"{url}/points.ply?field=5")
    count = sum(row["n"] == "5" for row in table(client, url))
    assert f"element vertex {count}\n".encode() in answer.content
    assert "field-00000005" in answer.headers["content-disposition"]
    assert client.get(f"{url}/points.ply?field=25").status_code == 404


def test_parquet_has_the_rows_of_the_table(measured: tuple[TestClient, str], tmp_path: Path) -> None:
    pq = pytest.importorskip("pyarrow.parquet")
    client, url = measured
    answer = client.get(f"{url}/points.parquet")
    assert answer.headers["content-type"] == "application/vnd.apache.parquet"
    (tmp_path / "points.parquet").write_bytes(answer.content)
    found = pq.read_table(tmp_path / "points.parquet")
    rows = table(client, url)
    assert found["target"].to_pylist() == [int(row["target"]) for row in rows]
    assert found["z_mm"].to_pylist() == [float(row["z_mm"]) for row in rows]
    assert url.endswith(json.loads(found.schema.metadata[b"grabberd"])["capture"])


def test_mat_has_a_place_for_every_row_of_the_table(measured: tuple[TestClient, str], tmp_path: Path) -> None:
    client, url = measured
    answer = client.get(f"{url}/points.mat?run=1")
    assert answer.headers["content-type"] == "application/x-matlab-data"
    assert answer.headers["content-disposition"].endswith('-points.mat"')
    (tmp_path / "points.mat").write_bytes(answer.content)
    points = by_matio(tmp_path / "points.mat")["points"]
    assert points["xyz_mm"].shape[0] == 20
    z_mm = {
        (int(points["n"][i, 0]), int(points["target"][0, k])): points["xyz_mm"][i, k, 2]
        for i, k in np.argwhere(np.isfinite(points["residual_px"]))
    }
    assert z_mm == {(int(row["n"]), int(row["target"])): float(row["z_mm"]) for row in table(client, url)}


def test_c3d_has_a_marker_for_every_row_of_the_table(
    measured: tuple[TestClient, str], tmp_path: Path
) -> None:
    ezc3d = pytest.importorskip("ezc3d")
    client, url = measured
    answer = client.get(f"{url}/points.c3d?run=1")
    assert answer.headers["content-disposition"].endswith('-points.c3d"')
    (tmp_path / "points.c3d").write_bytes(answer.content)
    read = ezc3d.c3d(str(tmp_path / "points.c3d"))
    labels = [int(label[1:].partition("_")[0]) for label in read["parameters"]["POINT"]["LABELS"]["value"]]
    z_mm = read["data"]["points"][2]
    found = {(int(n), labels[k]): z_mm[k, n] for k, n in np.argwhere(np.isfinite(z_mm))}
    rows = {(int(row["n"]), int(row["target"])): float(row["z_mm"]) for row in table(client, url)}
    assert found == pytest.approx(rows, abs=1e-5)


@pytest.mark.parametrize("kind", ["csv", "ply", "parquet", "mat", "c3d"])
def test_a_run_or_capture_that_there_is_not_is_a_problem(measured: tuple[TestClient, str], kind: str) -> None:
    client, url = measured
    for asked in (f"{url}/points.{kind}?run=7", f"{CAPTURES}/none/points.{kind}"):
        answer = client.get(asked)
        assert answer.status_code == 404
        assert answer.json()["hint"]


def test_without_the_optional_part_it_is_501_and_how_to_install_it(
    measured: tuple[TestClient, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    client, url = measured
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    answer = client.get(f"{url}/points.parquet")
    assert answer.status_code == 501
    assert "pip install 'grabberd[parquet]'" in answer.json()["hint"]


def test_the_daemon_itself_never_imports_it(
    measured: tuple[TestClient, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    client, url = measured
    for name in [name for name in sys.modules if re.match(r"pyarrow\b|scipy\.io\b", name)]:
        monkeypatch.delitem(sys.modules, name)
    for kind in ("parquet", "mat"):
        assert client.get(f"{url}/points.{kind}").status_code in (200, 501)
    assert not {"pyarrow", "scipy.io"} & sys.modules.keys()


def test_the_head_is_answered_without_making_the_file(measured: tuple[TestClient, str]) -> None:
    client, url = measured
    for kind in ("csv", "ply", "mat", "c3d"):
        answer = client.head(f"{url}/points.{kind}")
        assert (answer.status_code, answer.content) == (200, b"")
