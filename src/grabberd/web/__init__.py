"""The operator's page: HTML document and static files. This room does not know what the daemon does.

`types/` holds the types that the page's modules are checked against; they are neither served nor packaged.
"""

from grabberd.web.files import Files, StaticFile
from grabberd.web.page import POLICY, language_of, render

__all__ = ["POLICY", "Files", "StaticFile", "language_of", "render"]
