"""Pictures of more than 8 bits as grey values of 8: their upper bits, by one scale for the whole recording.

Cameras of 10, 12 or 14 bits are usually stored in 16, either at the lower end (values up to 1023, 4095 or
16383) or at the upper one (the lowest bits are all zero). A picture itself shows which.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.errors import PictureError

KNOWN_BITS = (8, 10, 12, 14, 16)
_STORED = 16
_FEWEST_ZERO = 4
"""Lowest bits that are always zero where 12 bits or fewer stand at the upper end."""


class Levels(NamedTuple):
    """Scale of a recording's samples.

    Attributes:
        bits: significant bits of a sample, which begin at its lowest one: 16 also where these are all zero.
        guessed: True if they follow from the first picture's brightest value.
    """

    bits: int
    guessed: bool = False

    @classmethod
    def of(cls, picture: NDArray[np.uint8] | NDArray[np.uint16], bits: int | None = None) -> "Levels":
        """Those of a recording with this first picture, or with so many bits."""
        if picture.dtype == np.uint8:
            return cls(8)
        if bits is not None:
            return cls(bits)
        occurring = int(np.bitwise_or.reduce(picture, axis=None))
        if occurring and occurring & -occurring >= 1 << _FEWEST_ZERO:
            return cls(_STORED)
        found = next(known for known in KNOWN_BITS if occurring < 1 << known)
        return cls(found, guessed=found < _STORED)

    def grey(self, path: Path, picture: NDArray[np.uint8] | NDArray[np.uint16]) -> NDArray[np.uint8]:
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
                f"{path} has values up to {largest}, expected at most {most} of {self.bits} bits{origin}",
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
