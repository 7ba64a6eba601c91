"""The ring in use."""

from dataclasses import dataclass

from grabberd.acquisition import Ring


@dataclass(frozen=True, slots=True)
class ConfiguredRing:
    """The ring in use and how fields are put into it."""

    ring: Ring
    bits: int
    lines: str


def default_lines(bits: int) -> str:
    """Doubled at 1 bit, intact for grey (paper 3.3)."""
    return "doubled" if bits == 1 else "field"
