"""The application with all of its commands."""

from grabberd.cli.application import application

app = application()
