"""Lines that a light hangs on, without the hardware: the kernel's answers, and somebody who unplugs them."""

import errno
import struct
import termios
from collections.abc import Callable
from pathlib import Path
from typing import Any

from drivers.loggers.ports import Port
from grabberd.runtime import Clock
from grabberd_loggers.light.gpio_line import USED, ChipInfo, GpioKernel, GpioLightOptions, GpioLine, LineInfo
from grabberd_loggers.light.serial_line import SerialLightOptions, SerialLine
from grabberd_loggers.light.switched_light import Line, SwitchedLight
from grabberd_loggers.options import Options


def light_on(line: Line, clock: Clock, chance: Callable[[], bool] | None = None) -> SwitchedLight:
    """The driver of a light on this line; `chance` is its state for each bit."""

    class Light(SwitchedLight):
        options_class = Options
        line_class = staticmethod(lambda _options: line)

        def _chance(self) -> bool:
            return super()._chance() if chance is None else chance()

    return Light(clock=clock)


class ModemLines:
    """A pseudo-terminal with the control lines that it lacks.

    Attributes:
        state: which of them are on, as the kernel tells it.
        asked: every request that changed them, and which.
    """

    def __init__(self) -> None:
        self.port = Port()
        self.state = termios.TIOCM_RTS | termios.TIOCM_DTR | termios.TIOCM_CTS
        self.asked: list[tuple[int, int]] = []
        self.gone = False

    def line(self, **options: Any) -> SerialLine:
        return SerialLine(SerialLightOptions(port=self.port.path, **options), self._ioctl)

    def _ioctl(self, file: int, request: int, word: bytes) -> bytes:
        if self.gone:
            raise OSError(errno.EIO, "Input/output error")
        [lines] = struct.unpack("i", word)
        if request == termios.TIOCMGET:
            return struct.pack("i", self.state)
        self.asked.append((request, lines))
        self.state = self.state | lines if request == termios.TIOCMBIS else self.state & ~lines
        return word

    def flip(self) -> None:
        self.state ^= termios.TIOCM_RTS

    def unplug(self) -> None:
        self.gone = True
        self.port.unplug()

    def close(self) -> None:
        self.port.close()


class GpioChip(GpioKernel):
    """A kernel with one chip of four lines, the last of which somebody uses.

    Attributes:
        value_of: state of each line that was taken, by its descriptor.
        taken: number, consumer and inversion of each.
    """

    NAMES = ("lamp", "", "fan", "reset")

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        (folder / "gpiochip3").touch()
        self.value_of: dict[int, bool] = {}
        self.taken: list[tuple[int, str, bool]] = []
        self.open_chips: set[int] = set()
        self.gone = False
        self.refusal: int | None = None

    def line(self, chip: str = "bench", line: int | str = "lamp", **options: Any) -> GpioLine:
        return GpioLine(GpioLightOptions(chip=chip, line=line, **options), self, self.folder)

    def open(self, path: str) -> int:
        if self.refusal is not None:
            raise OSError(self.refusal, "refused")
        if not Path(path).exists():
            raise OSError(errno.ENOENT, "No such file or directory")
        chip = 100 + len(self.open_chips)
        self.open_chips.add(chip)
        return chip

    def chip_info(self, chip: int) -> ChipInfo:
        assert chip in self.open_chips
        return ChipInfo("gpiochip3", "bench", len(self.NAMES))

    def line_info(self, chip: int, offset: int) -> LineInfo:
        assert chip in self.open_chips
        return LineInfo(self.NAMES[offset], *(("reboot", USED) if offset == 3 else ("", 0)))

    def take_output(self, chip: int, offset: int, consumer: str, inverted: bool) -> int:
        if offset == 3:
            raise OSError(errno.EBUSY, "Device or resource busy")
        self.taken.append((offset, consumer, inverted))
        line = 200 + len(self.taken)
        self.value_of[line] = False
        return line

    def set_value(self, line: int, on: bool) -> None:
        self._check()
        self.value_of[line] = on

    def value(self, line: int) -> bool:
        self._check()
        return self.value_of[line]

    def close(self, descriptor: int | None = None) -> None:
        """A descriptor; without one, the end of the bench."""
        if descriptor is not None:
            self.open_chips.discard(descriptor)

    def _check(self) -> None:
        if self.gone:
            raise OSError(errno.ENODEV, "No such device")

    def flip(self) -> None:
        line = max(self.value_of)
        self.value_of[line] = not self.value_of[line]

    def unplug(self) -> None:
        self.gone = True
        (self.folder / "gpiochip3").unlink()
