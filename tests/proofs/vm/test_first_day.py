"""A new user's first day on a fresh Debian: package, page, calibration, capture, notebook, tablet."""

import json
import os
import shutil
import socket
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from grabberd.archive.capture.reader import CaptureReader
from proofs.vm import film
from proofs.vm.first_day import Walk, curl, screenshot
from proofs.vm.guest import client, first_day, unit
from proofs.vm.image import CHECKOUT, cached_image
from proofs.vm.installed import new_disks
from proofs.vm.machine import Disks, Machine, concurrent, counted

PACKAGES = CHECKOUT / "dist" / "deb"
PAGE = CHECKOUT / "docs" / "reference" / "first-day.md"
PICTURE = CHECKOUT / "docs" / "images" / "first-day.png"
CONFIG, SHARE = "/etc/grabberd/grabberd.yaml", "/usr/lib/grabberd/share/grabberd"
SITE = "lib/python3.11/site-packages"
HERE = "http://127.0.0.1:8050"
MEMORY_MB = 2048
RMS_MM, WORST_MM = 0.11, 1.0
"""Of a single field of one bit, by a calibration of one pose."""
pytestmark = pytest.mark.timeout(3600)


@pytest.fixture(scope="module")
def folder() -> Iterator[Path]:
    made = Path(tempfile.mkdtemp(prefix="grabberd-first-day-"))
    yield made
    shutil.rmtree(made, ignore_errors=True)


@pytest.fixture(scope="module")
def disks(folder: Path) -> Disks:
    return new_disks(cached_image(), folder)


@pytest.fixture(scope="module")
def walk(disks: Disks, request: pytest.FixtureRequest) -> Iterator[Walk]:
    """A machine with a grabber, a package and wheels; the page is written at the end, if all went well."""
    with Machine(cached_image(), counted(0), disks=disks, memory_mb=MEMORY_MB) as machine:
        _provide(machine.share)
        machine.call(first_day.put_before_the_camera, film="/share/frame.film")
        one = Walk(machine)
        one.begin("Install")
        yield one
        page = one.document(os.cpu_count() or 1)
    with request.config.pluginmanager.getplugin("capturemanager").global_and_fixture_disabled():
        print(f"\n{page.partition('## ')[0]}")
    if request.config.getoption("--write-tables") and not request.session.testsfailed:
        PAGE.write_text(page)


def _provide(share: Path) -> None:
    """The package as it is handed on, the wheels of a notebook, and what the camera will see."""
    packages = list(PACKAGES.glob("grabberd_*.deb"))
    assert len(packages) == 1, "make deb makes the package"
    shutil.copy(packages[0], share)
    constraints = str(CHECKOUT / "constraints.txt")
    pip = [
        sys.executable,
        "-m",
        "pip",
        "download",
        "--quiet",
        "--only-binary=:all:",
        "--constraint",
        constraints,
    ]
    subprocess.run([*pip, "--dest", str(share / "wheels"), "pandas", "xarray"], check=True)
    film.render(share / "frame.film", film.CALIBRATION_FRAME)
    film.render(share / "liner.film")


def test_the_package_is_installed_and_the_service_runs(walk: Walk) -> None:
    walk.machine.call(first_day.type_in, line="cp -r /share/*.deb /share/wheels .")
    said = walk.types("apt-get install --yes ./grabberd_*_amd64.deb")
    assert f"{HERE}" in said
    assert CONFIG in said
    told = walk.waits("until systemd shows how the grabber fares", first_day.until_told)
    status = walk.types("systemctl status grabberd --no-pager")
    assert "Active: active (running)" in status
    walk.ends_with(f"the service runs and says `{told}`")


def test_the_grabber_is_set_up(walk: Walk) -> None:
    walk.begin("Set up the grabber")
    devices = walk.types(f"grabberd devices --config {CONFIG}")
    assert "/dev/video0" in devices
    walk.types(
        "sed -i 's|# input: S-Video|field_order: interlaced|; "
        f"s|# object: liner.yaml|object: {SHARE}/configs/objects/liner.yaml|' {CONFIG}"
    )
    walk.types(f"grabberd check-config {CONFIG}")
    walk.types("systemctl restart grabberd")
    walk.waits("until fields arrive", unit.until_ready)
    state = json.loads(walk.types(f"curl -sS {HERE}/api/v1/state"))
    details = state["devices"]["cup"]["stream"]["details"]
    assert details["field order of the driver"].lower() == "interlaced"
    walk.ends_with("`cup is ready`")


def test_the_page_and_the_documentation_are_there(walk: Walk) -> None:
    walk.begin("Open the page")
    fetched = walk.waits(f"a browser opens {HERE}", first_day.fetch_page)
    modules = [path for path in fetched if path.endswith(".js")]
    assert len(modules) > 40
    for page in ("", "howto/calibrate/", "tutorials/first_look/", "search/search_index.json"):
        walk.types(f"curl -sSf -o /dev/null {HERE}/docs/{page}")
    walk.ends_with(
        f"{len(fetched)} files, {len(modules)} of them modules, {sum(fetched.values()) / 1e6:.1f} MB"
    )


def test_the_rig_is_calibrated(walk: Walk) -> None:
    walk.begin("Calibrate")
    begun = json.loads(walk.types(curl("POST", "captures", '{"bits": 8, "duration_s": 2}')))
    frame = walk.waits("until the capture is sealed", client.sealed, capture_id=begun["id"])
    assert frame["verdict"] == "complete", frame["ledger"]
    order = json.dumps({"capture": begun["id"], "calibration_frame": "paper-108"})
    job = json.loads(walk.types(curl("POST", "calibrations", order)))
    ended = walk.waits("until the calibration is made", client.job_ended, job_id=job["id"])
    assert ended["state"] == "done", ended
    made = ended["result"]["calibration"]
    walk.types(curl("PUT", "calibrations/active", json.dumps({"id": made})))
    known = json.loads(walk.types(f"curl -sS {HERE}/api/v1/calibrations/{made}/report.json"))
    walk.ends_with(f"its acceptance: {known['acceptance']['verdict'].replace('_', ' ')}")
    assert known["acceptance"]["verdict"] != "failed"


def test_the_liner_is_captured_and_measured(walk: Walk) -> None:
    walk.begin("Capture")
    walk.machine.call(first_day.put_before_the_camera, film="/share/liner.film")
    walk.waits("until the liner is measured", first_day.until_measured, points=60)
    walk.types(
        f"grabberd capture --url {HERE} --fields 100 --label cow=112 --label liner=A --out liner.grab", 900
    )
    walk.types("grabberd export liner.grab --format csv --out liner-points")
    walk.machine.call(first_day.type_in, line="cp liner.grab liner-points/points.csv /share")
    with CaptureReader(walk.machine.share / "liner.grab") as reader:
        errors_mm = film.errors_mm(reader, film.stamps(reader))
        counts = {str(outcome): count for outcome, count in reader.ledger.counts().items() if count}
    rms_mm = float(np.sqrt((errors_mm**2).mean()))
    lost = sum(counts.values()) - counts["received"]
    walk.ends_with(
        f"{counts['received']} fields, {lost} lost; {len(errors_mm)} points, {rms_mm:.3f} mm rms off truth"
    )
    assert len(errors_mm) == (walk.machine.share / "points.csv").read_text().count("\n") - 1
    assert len(errors_mm) > 60 * counts["received"]
    assert rms_mm < RMS_MM
    assert errors_mm.max() < WORST_MM


def test_a_notebook_runs_beside_the_package(walk: Walk) -> None:
    walk.begin("Run a notebook")
    walk.types("python3 -m venv notebook")
    walk.types(f"echo /usr/lib/grabberd/{SITE} > notebook/{SITE}/grabberd.pth")
    walk.types("notebook/bin/pip install --no-index --find-links wheels pandas xarray")
    walk.types(f"curl -sSfO {HERE}/docs/tutorials/first_look.ipynb")
    walk.types("""sed -i 's|grabberd.example(\\\\"liner.grab\\\\")|\\\\"liner.grab\\\\"|' first_look.ipynb""")
    said = walk.types(
        "notebook/bin/python /checkout/tests/proofs/vm/guest/notebook.py first_look.ipynb /share", 1400
    )
    assert "cow: 112" in said or "'cow': '112'" in said
    assert "first_look.ipynb: ran to its end, 5 pictures" in said
    assert len(list(walk.machine.share.glob("first_look-*.png"))) == 5
    walk.ends_with("from its first cell to its last, 5 pictures")


def test_a_tablet_signs_in_after_the_next_boot(
    walk: Walk, disks: Disks, folder: Path, request: pytest.FixtureRequest
) -> None:
    walk.begin("Let a tablet in")
    add = f"runuser -u grabberd -- grabberd token add tablet --role operator --config {CONFIG}"
    token = next(word for word in walk.types(add).split() if word.startswith("grabberd_"))
    drop_in = "/etc/systemd/system/grabberd.socket.d"
    walk.types(f"mkdir -p {drop_in}; cp {SHARE}/systemd/drop-ins/network.conf {drop_in}")
    walk.types("systemctl daemon-reload; systemctl restart grabberd.socket grabberd")
    walk.waits("until fields arrive", unit.until_ready)
    refused = walk.types(f"curl -sS -o /dev/null -w '%{{http_code}}' {HERE}/api/v1/state")
    assert refused == "401"
    walk.machine.call(unit.settle_disks)
    walk.machine.kill()
    chromium = shutil.which("chromium")
    if chromium is None:
        pytest.skip("Chromium is missing: sudo apt-get install chromium")
    port = _free_port()
    with Machine(
        cached_image(), concurrent(), disks=disks, memory_mb=MEMORY_MB, forwarded=(port, 8050)
    ) as machine:
        machine.call(first_day.until_told, timeout_s=900)
        machine.call(first_day.connect_network)
        machine.call(first_day.until_answering, timeout_s=900)
        errors = screenshot(chromium, "grabberd-vm", port, token, folder / "page.png")
    assert errors == []
    walk.ends_with("started again, the page in another computer's browser")
    if request.config.getoption("--write-tables"):
        shutil.copy(folder / "page.png", PICTURE)


def _free_port() -> int:
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])
