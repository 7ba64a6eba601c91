"""The luma of a camera's JPEG pictures; a broken one is told in words and never ends the stream."""

import numpy as np
from numpy.typing import NDArray

_SOI, _EOI = b"\xff\xd8", b"\xff\xd9"
_FILL, _SOS = 0xFF, 0xDA
_FRAMES = (0xC0, 0xC1, 0xC2)
"""Markers with the picture's size: baseline, extended and progressive coding by Huffman's method."""
_MOST_HEADER = 65_536
_BLOCK = 8
_NOTHING_LEFT = 128
"""Grey of the blocks for which the decoder had no data left."""


class JpegLuma:
    """Decodes one stream's pictures.

    Args:
        lines, columns: size of every picture.
    """

    def __init__(self, lines: int, columns: int) -> None:
        import cv2  # noqa: PLC0415 - 16 MB, for compressed streams alone

        self._cv2 = cv2
        self._how = cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION
        self._shape = lines, columns
        self._last: NDArray[np.uint8] | None = None  # whole

    def decode(self, data: NDArray[np.uint8]) -> tuple[NDArray[np.uint8] | None, str | None]:
        """The luma of a picture, and what is wrong with it.

        A picture that breaks off is grey from there on. In place of one that cannot be decoded the last
        whole picture is returned; None if there was none yet.

        Args:
            data: (n,) uint8, as the camera sent them.

        Returns:
            (lines, columns) uint8, and the damage in words, or None.
        """
        fault = _fault(data, self._shape)
        luma = None if fault else self._decoded(data)
        if luma is None or luma.shape != self._shape:
            return self._last, f"broken JPEG: {fault or 'it cannot be decoded'}"
        # The header alone does not tell: lost bytes in the middle leave too few for the last blocks.
        if (luma[-_BLOCK:, -_BLOCK:] == _NOTHING_LEFT).all():
            return luma, "broken JPEG: data are missing"
        self._last = luma
        return luma, None

    def _decoded(self, data: NDArray[np.uint8]) -> NDArray[np.uint8] | None:
        if _EOI not in data[-_MOST_HEADER:].tobytes():  # then the decoder would give nothing at all
            data = np.concatenate([data, np.frombuffer(_EOI, np.uint8)])
        try:
            return self._cv2.imdecode(data, self._how)  # type: ignore[return-value]
        except self._cv2.error:
            return None


def _fault(data: NDArray[np.uint8], shape: tuple[int, int]) -> str | None:
    """The reason why data are no JPEG of this size, as far as their header tells.

    Checked before they are decoded: a header that claims 65 535 lines costs gigabytes.
    """
    header = data[:_MOST_HEADER].tobytes()
    if not header:
        return "it is empty"
    if not header.startswith(_SOI):
        return "it does not begin like one"
    size = _size(header)
    if size is None:
        return "its header breaks off"
    if size != shape:
        return f"it has {size[1]}×{size[0]} pixels, not {shape[1]}×{shape[0]}"
    return None


def _size(header: bytes) -> tuple[int, int] | None:
    """Lines and columns by the segments before the scan; None if they do not tell, or there is no scan."""
    at, size = len(_SOI), None
    while at + 4 <= len(header) and header[at] == _FILL:
        marker = header[at + 1]
        if marker == _SOS:
            return size
        if marker in _FRAMES:
            lines, columns = header[at + 5 : at + 7], header[at + 7 : at + 9]
            size = int.from_bytes(lines, "big"), int.from_bytes(columns, "big")
        # A marker may have any number of filling bytes before it.
        at += 1 if marker == _FILL else 2 + int.from_bytes(header[at + 2 : at + 4], "big")
    return None
