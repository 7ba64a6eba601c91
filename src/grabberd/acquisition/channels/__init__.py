"""The documented path of channels and of the logger contract."""

from grabberd.core.channels import *  # noqa: F403
