"""A GPIO chip that the kernel simulates (gpio-sim): lines that are switched, and what stands on them."""

from pathlib import Path
from typing import Any

from grabberd.errors import GrabberdError
from grabberd_loggers.light.gpio_line import GpioLight
from proofs.vm.guest.shell import run, wait_for

LABEL = "grabberd-bench"
LAMP = 2
_CONFIG = Path("/sys/kernel/config/gpio-sim/bench")


def plug_in() -> bool:
    """A chip of four lines, one of which is named; False if this kernel cannot simulate one."""
    try:
        run("modprobe gpio-sim")
    except RuntimeError:
        return False
    run("mountpoint -q /sys/kernel/config || mount -t configfs none /sys/kernel/config")
    (_CONFIG / "bank" / f"line{LAMP}").mkdir(parents=True)
    (_CONFIG / "bank" / "num_lines").write_text("4")
    (_CONFIG / "bank" / "label").write_text(LABEL)
    (_CONFIG / "bank" / f"line{LAMP}" / "name").write_text("lamp")
    (_CONFIG / "live").write_text("1")
    wait_for(lambda: _chip() and Path("/dev", _chip()).exists())
    return True


def unplug() -> None:
    """Takes the chip away, whoever has a line of it."""
    (_CONFIG / "live").write_text("0")
    for part in (_CONFIG / "bank" / f"line{LAMP}", _CONFIG / "bank", _CONFIG):
        part.rmdir()


def is_plugged_in() -> bool:
    """True until it is unplugged."""
    return _CONFIG.exists()


def _chip() -> str:
    return (_CONFIG / "bank" / "chip_name").read_text().strip()


def on_the_line() -> bool:
    """What the simulated hardware has on the lamp's line."""
    device = (_CONFIG / "dev_name").read_text().strip()
    value = Path("/sys/devices/platform", device, _chip(), f"sim_gpio{LAMP}", "value")
    return value.read_text().strip() == "1"


def switched(seconds: float, **options: Any) -> dict[str, Any]:
    """The light switched for a while: what it said after each read, and what stood on the line then."""
    light = GpioLight(**{"chip": LABEL, "line": "lamp", **options})
    info = light.open()
    told, seen, widths_us = [], [], []
    try:
        for _ in range(round(seconds / 0.1)):
            readings = light.read(0.2)
            told.append(float(readings.values[-1, 0]))
            seen.append(on_the_line())
            widths_us.append(int(readings.time_ns[-1] - readings.time_ns[-2]) / 1e3)
    finally:
        light.close()
    return {
        "details": info.details,
        "told": told,
        "seen": seen,
        "after": on_the_line(),
        "quickest_us": min(widths_us),
    }


def refusal(**options: Any) -> dict[str, Any] | None:
    """Why a light is not opened; None if it is."""
    light = GpioLight(**{"chip": LABEL, "line": "lamp", **options})
    try:
        light.open()
    except GrabberdError as error:
        return {"kind": type(error).__name__, "message": error.message, "hint": error.hint}
    finally:
        light.close()
    return None


def of_a_line_in_use() -> dict[str, Any] | None:
    """The refusal of a line that another light has."""
    first = GpioLight(chip=LABEL, line="lamp")
    first.open()
    try:
        return refusal(line=LAMP)
    finally:
        first.close()


def lost() -> dict[str, Any]:
    """What is said when the chip goes away under the light."""
    light = GpioLight(chip=LABEL, line="lamp")
    light.open()
    unplug()
    try:
        for _ in range(5):
            light.read(0.2)
    except GrabberdError as error:
        return {"kind": type(error).__name__, "message": error.message}
    finally:
        light.close()
    return {"kind": "nothing", "message": ""}
