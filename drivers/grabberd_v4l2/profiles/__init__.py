"""Profiles of kernel drivers: a YAML file for each, overridden by the installer's own."""

from grabberd_v4l2.profiles.profile import DEFAULT, DIRECTORY, Profile, Profiles, SignalSource

__all__ = ["DEFAULT", "DIRECTORY", "Profile", "Profiles", "SignalSource"]
