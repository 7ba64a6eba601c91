"""Samples of pictures as grey values of 8 bits, whatever they were stored in: one rule for files and videos.

Grey values are those that were stored: neither the range of a video (16 to 235, or 0 to 255) nor a gamma is
converted, and a mark that a picture be turned is not followed. Luma is taken as it was coded; only colours
without one become luma, by Rec. 601, as in a grabber.

Cameras of 10, 12 or 14 bits are usually stored in 16, either at the lower end (values up to 1023, 4095 or
16383) or at the upper one (the lowest bits are all zero). A picture itself shows which; one scale is for the
whole recording.
"""

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from grabberd.errors import PictureError

Samples = NDArray[np.uint8] | NDArray[np.uint16]
KNOWN_BITS = (8, 10, 12, 14, 16)
STORED_BITS = 16
FROM_COLOURS = "converted to luma by Rec. 601"
_FEWEST_ZERO = 4
"""Lowest bits that are always zero where 12 bits or fewer stand at the upper end."""


def from_colours(picture: Samples) -> Samples:
    """Luma of a picture (lines, columns, 3) of blue, green and red, by Rec. 601; (lines, columns)."""
    luma = cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)
    return np.asarray(luma, np.uint8) if picture.dtype == np.uint8 else np.asarray(luma, np.uint16)


class Levels(NamedTuple):
    """Scale of a recording's samples.

    Attributes:
        bits: significant bits of a sample, which begin at its lowest one: 16 also where these are all zero.
        guessed: True if they follow from the first picture's brightest value.
    """

    bits: int
    guessed: bool = False

    @classmethod
    def of(cls, picture: Samples, bits: int | None = None) -> "Levels":
        """Those of a recording with this first picture, or with so many bits."""
        if picture.dtype == np.uint8:
            return cls(8)
        if bits is not None:
            return cls(bits)
        occurring = int(np.bitwise_or.reduce(picture, axis=None))
        if occurring and occurring & -occurring >= 1 << _FEWEST_ZERO:
            return cls(STORED_BITS)
        found = next(known for known in KNOWN_BITS if occurring < 1 << known)
        return cls(found, guessed=found < STORED_BITS)

    def grey(self, name: object, picture: Samples) -> NDArray[np.uint8]:
        """The upper 8 bits of a picture.

        Raises:
            PictureError: it has values that so many bits cannot have.
        """
        if picture.dtype == np.uint8:
            return picture.astype(np.uint8, copy=False)
        largest, most = int(picture.max()), (1 << self.bits) - 1
        if largest > most:
            origin = ", as many as the first picture has" if self.guessed else ""
            raise PictureError(
                f"{name} has values up to {largest}, expected at most {most} of {self.bits} bits{origin}",
                f"give 'bits', one of {', '.join(map(str, KNOWN_BITS))}; what came before it is kept",
            )
        return (picture >> (self.bits - 8)).astype(np.uint8)

    @property
    def details(self) -> dict[str, str]:
        """Stream detail for pictures that were scaled."""
        return {} if self.bits == 8 else {"samples": f"the upper 8 of {self.bits} bits"}

    @property
    def remarks(self) -> tuple[str, ...]:
        """Remark on a scale that nobody stated."""
        if not self.guessed:
            return ()
        return (
            f"Its pictures are stored with 16 bits a sample; by the values in the first, {self.bits} of them "
            "are significant, of which the upper 8 are used. If the camera has others, say so with 'bits'.",
        )
