"""The operator's page, its HTML document and static files, and the documentation's site.

This room does not know what the daemon does.

`types/` holds the types that the page's modules are checked against; they are neither served nor packaged.
"""

from grabberd.server.web.page import POLICY, Files, Site, StaticFile, language_of, render

__all__ = ["POLICY", "Files", "Site", "StaticFile", "language_of", "render"]
