"""Misses: why a target that should have been found in a field was not."""

from enum import IntEnum


class Miss(IntEnum):
    """Outcome of the search for one target in one field.

    The first ones are also those of the compiled kernel (space.h): one bit for each view without a blob.
    """

    FOUND = 0
    NO_BLOB_LEFT = 1
    """No blob near its predicted image in the left view."""
    NO_BLOB_RIGHT = 2
    NO_BLOB = 3
    """None in either view."""
    RAYS_APART = 4
    """There is a blob in both views, but their rays do not meet."""
    OFF_PLACE = 5
    """The rays meet too far from where its neighbours put it."""
    UNCONFIRMED = 6
    """Found, but only once after a long time and hence not reported: it may have been a false blob."""
    NOT_IDENTIFIED = 7
    """No target was identified in the whole field."""
    CUT_OFF = 8
    """Its predicted image is cut off by the edge of its view."""
    UNPREDICTED = 9
    """Its neighbours are too far away to predict it."""

    @property
    def key(self) -> str:
        """Its name in documents."""
        return self.name.lower()
