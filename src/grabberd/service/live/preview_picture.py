"""The newest field as a PNG picture, encoded once for all clients."""

import threading

import cv2

from grabberd.errors import NotReady
from grabberd.service.device.threshold_keeper import Shown
from grabberd.service.instrument import Instrument

FIELD_WITHIN_S = 0.5
FAST = 1


class PreviewPicture:
    """The picture of one device; any thread may call."""

    def __init__(self, instrument: Instrument) -> None:
        self._instrument = instrument
        self._encoding = threading.Lock()
        self._of: Shown | None = None
        self._png = b""

    def png(self) -> bytes:
        """The newest field in 8 bits, with its lines as recorded.

        Raises:
            NotReady: the device delivers no field.
        """
        shown = self._instrument.pipeline.newest.recent(FIELD_WITHIN_S)
        if shown is None:
            status = self._instrument.board.now
            raise NotReady(
                f"device {self._instrument.name} is {status.state} and has delivered no field "
                f"for {FIELD_WITHIN_S:g} s",
                status.hint or "wait until its state is ready: GET /api/v1/state",
            )
        with self._encoding:
            if self._of is not shown:
                self._of, self._png = shown, _png(shown)
            return self._png


def _png(shown: Shown) -> bytes:
    return bytes(cv2.imencode(".png", shown.field.luma, [cv2.IMWRITE_PNG_COMPRESSION, FAST])[1])
