"""The documented path of measurement."""

from grabberd.core.measurement import *  # noqa: F403
