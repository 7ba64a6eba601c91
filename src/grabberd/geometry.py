"""The documented path of the camera geometry."""

from grabberd.core.geometry import *  # noqa: F403
