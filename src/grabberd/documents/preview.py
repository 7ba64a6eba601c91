"""Messages of a client of the preview: which picture it wants, and what it has taken."""

from typing import Literal

from pydantic import Field

from grabberd.documents.document import Document

LARGEST_SIDE_PX = 4096


class PreviewPart(Document):
    """A part of the frame, in frame pixels."""

    x: int = Field(ge=0, le=LARGEST_SIDE_PX)
    y: int = Field(ge=0, le=LARGEST_SIDE_PX)
    columns: int = Field(ge=1, le=LARGEST_SIDE_PX)
    lines: int = Field(ge=1, le=LARGEST_SIDE_PX)


class PreviewAsk(Document):
    """The picture that a client wants from now on."""

    picture: Literal["grey", "bits"] = "grey"
    part: PreviewPart | None = None
    width_px: int | None = Field(None, ge=1, le=16384)
    """Pixels that the client's screen has for the width of the frame."""
    rate_hz: float | None = Field(None, ge=0.1, le=200)
    """Pictures a second that it wants at most; null: as many as its link carries."""
    light: bool = False
    """Whether the light of the newest field is sent, too, as text: that of `devices/{name}/light`."""


class PreviewWords(Document):
    """A message of a client."""

    ask: PreviewAsk | None = None
    taken: int = Field(0, ge=0, le=1000)
    """Pictures that it has taken since its last message."""
