"""The ring in use, with the bits and lines that it is configured for."""

from dataclasses import dataclass

from grabberd.acquisition import Ring


@dataclass(frozen=True, slots=True)
class ConfiguredRing:
    """A ring and how fields are put into it; other bits or lines make another one.

    Attributes:
        ring: Slots of packed fields.
        bits: Bits per pixel.
        lines: "doubled" or "field".
    """

    ring: Ring
    bits: int
    lines: str


def default_lines(bits: int) -> str:
    """Lines of a ring unless configured: doubled at 1 bit, intact for grey (paper 3.3)."""
    return "doubled" if bits == 1 else "field"
