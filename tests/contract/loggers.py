"""One logger of every kind, with the other end of its cable: what it is told to say, it says."""

import time
from pathlib import Path

from drivers.loggers.iio_tree import IioTree
from drivers.loggers.light_lines import GpioChip, ModemLines, light_on
from drivers.loggers.ports import Port
from grabberd.core.channels import Logger
from grabberd.testing import COUNT, ManualClock
from grabberd_fake import FakeLight, FakeLogger
from grabberd_loggers.csv_file import CsvLogger
from grabberd_loggers.iio.logger import IioLogger
from grabberd_loggers.serial_port import SerialLogger

MS = 1_000_000


class FakeBench:
    """The simulated logger, whose clock stands until somebody waits on it."""

    columns = 4

    def __init__(self, dating: str, packet_ms: float) -> None:
        self.clock = ManualClock()
        faults = [{"kind": "nonsense", "at_s": 100}, {"kind": "unplugged", "at_s": 200, "for_s": 50}]
        self.logger: Logger = FakeLogger(clock=self.clock, dating=dating, packet_ms=packet_ms, faults=faults)
        self._begin_ns = self.clock.time_ns

    def say(self, count: int = COUNT) -> None:
        """It never stops."""

    def spoil(self) -> None:
        self.clock.time_ns = self._begin_ns + 100_100 * MS

    def unplug(self) -> None:
        self.clock.time_ns = self._begin_ns + 200_100 * MS

    def now_ns(self) -> int:
        return self.clock.time_ns

    def close(self) -> None:
        self.logger.close()


class LineBench:
    """A logger of lines; `write` puts them on its way."""

    logger: Logger
    timed: bool
    columns = 4

    def __init__(self) -> None:
        self._number = 0

    def write(self, text: str) -> None:
        raise NotImplementedError

    def say(self, count: int = COUNT) -> None:
        for _ in range(count):
            self._number += 1
            own = f"{self._number * 5}," if self.timed else ""
            self.write(f"{own}{self._number % 50},0.5,18.0,44.0\n")

    def spoil(self) -> None:
        self.write("Overflow!\n")

    def now_ns(self) -> int:
        return time.monotonic_ns()


class SerialBench(LineBench):
    def __init__(self, timed: bool, **options: object) -> None:
        super().__init__()
        self.timed, self.port = timed, Port()
        columns = [f"p{n} [kPa]" for n in range(1, 5)]
        columns = ["time_ms", *columns] if timed else columns
        self.logger = SerialLogger(port=str(self.port.path), columns=columns, **options)

    def write(self, text: str) -> None:
        self.port.say(text)

    def unplug(self) -> None:
        self.port.unplug()

    def close(self) -> None:
        self.logger.close()
        self.port.close()


class CsvBench(LineBench):
    timed = True

    def __init__(self, folder: Path) -> None:
        super().__init__()
        self.path, self.clock = folder / "log.csv", ManualClock()
        self.path.write_text("time_ms,p1 [kPa],p2 [kPa],p3 [kPa],p4 [kPa]\n")
        self.logger = CsvLogger(path=str(self.path), clock=self.clock)

    def write(self, text: str) -> None:
        with self.path.open("a") as file:
            file.write(text)

    def unplug(self) -> None:
        self.path.unlink()

    def now_ns(self) -> int:
        return self.clock.time_ns

    def close(self) -> None:
        self.logger.close()


class IioBench:
    columns = 4

    def __init__(self, folder: Path, buffered: bool) -> None:
        self.tree, self.clock, self.buffered = IioTree(folder), ManualClock(), buffered
        if buffered:
            self.tree.add_buffer()
        self.logger = IioLogger(device="milk-line", rate_hz=200, clock=self.clock, roots=self.tree.roots)

    def say(self, count: int = COUNT) -> None:
        if self.buffered:
            begin_ns = self.clock.time_ns
            self.clock.sleep(count * 0.005)
            self.tree.scans([begin_ns + (n + 1) * 5 * MS for n in range(count)])

    def spoil(self) -> None:
        if self.buffered:
            self.tree.scans([1_700_000_000_000_000_000])
        else:
            self.tree.write("in_pressure_raw", "error")

    def unplug(self) -> None:
        self.tree.unplug()

    def now_ns(self) -> int:
        return self.clock.time_ns

    def close(self) -> None:
        self.logger.close()
        self.tree.close()


class LightBench:
    """A light that is switched by the driver; its clock stands until somebody waits on it."""

    columns = 1

    def __init__(self, lines: ModemLines | GpioChip) -> None:
        self.lines, self.clock = lines, ManualClock()
        self.logger = light_on(lines.line(), self.clock)

    def say(self, count: int = COUNT) -> None:
        """It never stops."""

    def spoil(self) -> None:
        self.lines.flip()

    def unplug(self) -> None:
        self.lines.unplug()

    def now_ns(self) -> int:
        return self.clock.time_ns

    def close(self) -> None:
        self.logger.close()
        self.lines.close()


class FakeLightBench(FakeBench):
    """The simulated light."""

    columns = 1

    def __init__(self) -> None:
        super().__init__("monotonic", 0)
        faults = [{"kind": "other_hand", "at_s": 100}, {"kind": "unplugged", "at_s": 200, "for_s": 50}]
        self.logger = FakeLight(clock=self.clock, faults=faults)


BENCHES = {
    "fake_own_clock": lambda _: FakeBench("own_clock", 16),
    "fake_monotonic": lambda _: FakeBench("monotonic", 0),
    "fake_arrival": lambda _: FakeBench("arrival", 16),
    "serial_timed": lambda _: SerialBench(timed=True),
    "serial_counted": lambda _: SerialBench(timed=False, rate_hz=200),
    "serial_untimed": lambda _: SerialBench(timed=False),
    "csv": CsvBench,
    "iio_polled": lambda folder: IioBench(folder, buffered=False),
    "iio_buffered": lambda folder: IioBench(folder, buffered=True),
    "rts": lambda _: LightBench(ModemLines()),
    "gpio": lambda folder: LightBench(GpioChip(folder)),
    "fake_light": lambda _: FakeLightBench(),
}
