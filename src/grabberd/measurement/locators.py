"""The documented path of the locator contract."""

from grabberd.core.measurement.locators import *  # noqa: F403
