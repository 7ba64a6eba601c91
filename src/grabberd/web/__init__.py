"""The operator's page and its files. Nothing here knows what the daemon does."""

from grabberd.web.files import Files, StaticFile
from grabberd.web.page import POLICY, language_of, render

__all__ = ["POLICY", "Files", "StaticFile", "language_of", "render"]
