"""A computer with industrial I/O devices, as folders and files."""

import os
import shutil
from pathlib import Path

import numpy as np

from grabberd.instrument.acquisition.device import Roots


class IioTree:
    """The kernel's tree with one pressure sensor and converter, `iio:device0`."""

    def __init__(self, folder: Path) -> None:
        self.roots = Roots(folder / "sys", folder / "dev")
        self.device = self.roots.sys / "bus" / "iio" / "devices" / "iio:device0"
        self.device.mkdir(parents=True)
        self.roots.dev.mkdir()
        self.write("name", "bmp280-barn")
        self.write("label", "milk-line")
        self.write("in_pressure_raw", "1000")
        self.write("in_pressure_scale", "0.05")
        self.write("in_pressure_offset", "-20")
        for channel in range(3):
            self.write(f"in_voltage{channel}_raw", str(100 * channel))
        self.write("in_voltage_scale", "0.5")
        self._pipe: int | None = None

    def write(self, name: str, text: str) -> None:
        file = self.device / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(f"{text}\n")

    def read(self, name: str) -> str:
        return (self.device / name).read_text().strip()

    def add_buffer(self, clock: str | None = "realtime") -> None:
        """A buffer with scans of 24 bytes: pressure, three voltages, a time."""
        for name in ("buffer/enable", "buffer/length"):
            self.write(name, "0")
        types = {"pressure": "le:s24/32>>8", "timestamp": "le:s64/64>>0"}
        for index, name in enumerate(("pressure", "voltage0", "voltage1", "voltage2", "timestamp")):
            self.write(f"scan_elements/in_{name}_en", "0")
            self.write(f"scan_elements/in_{name}_index", str(index))
            self.write(f"scan_elements/in_{name}_type", types.get(name, "be:u12/16>>4"))
        self.write("sampling_frequency", "100")
        if clock is not None:
            self.write("current_timestamp_clock", clock)
        node = self.roots.dev / "iio:device0"
        os.mkfifo(node)
        self._pipe = os.open(node, os.O_RDWR | os.O_NONBLOCK)

    def scans(self, times_ns: list[int], pressure: int = 1000) -> None:
        """Let scans arrive."""
        layout = np.dtype(
            {
                "names": ["pressure", "voltage", "time"],
                "formats": ["<i4", (">u2", 3), "<i8"],
                "offsets": [0, 4, 16],
                "itemsize": 24,
            }
        )
        scans = np.zeros(len(times_ns), layout)
        scans["pressure"] = pressure << 8
        scans["voltage"] = np.array([0, 100, 200]) << 4
        scans["time"] = times_ns
        self.say(scans.tobytes())

    def say(self, data: bytes) -> None:
        assert self._pipe is not None
        os.write(self._pipe, data)

    def unplug(self) -> None:
        for file in self.device.glob("in_*"):
            file.write_text("")  # who has one open reads no more from it
        shutil.rmtree(self.device)
        self.close()

    def close(self) -> None:
        if self._pipe is not None:
            os.close(self._pipe)
            self._pipe = None
