"""The documented path of video fields."""

from grabberd.core.field import *  # noqa: F403
