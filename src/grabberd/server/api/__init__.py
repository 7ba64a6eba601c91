"""HTTP API: routes over the service, errors as problem details (RFC 9457). It measures and stores nothing.

`guard` admits or refuses every request before a route sees it, `routes` translate between HTTP and the
service, `streams` make the responses that go on while a client listens, `readings` and `contents` read what
takes long, `openapi` completes the description and draws it as a page. `app` puts them together, `serving`
runs the application on sockets. Blocking calls are made in plain `def` routes, which the server runs in
threads beside its event loop.
"""

from grabberd.server.api.app import create_app

__all__ = ["create_app"]
