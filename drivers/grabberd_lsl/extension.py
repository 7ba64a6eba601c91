"""The Lab Streaming Layer as an extension: the command that streams points and events of a daemon to it."""

from grabberd.extension import Extension, Place

EXTENSION = Extension(name="lsl", groups=(Place("outlet", "grabberd_lsl.command", after="jobs"),))
