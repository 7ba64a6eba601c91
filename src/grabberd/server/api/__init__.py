"""HTTP API: routes over the service, errors as problem details (RFC 9457). It measures and stores nothing.

`guard` admits or refuses every request before a route sees it, `routes` translate between HTTP and the
service, `streams` produce long-lived responses, `readings` and `contents` do slow reads, `openapi` completes
the description and renders it as a page. `app` assembles the application, `serving` runs it on sockets.
Blocking calls are made in plain `def` routes, which the server runs in threads.
"""

from grabberd.server.api.app import create_app

__all__ = ["create_app"]
