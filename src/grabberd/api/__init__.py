"""HTTP: routes over the service, errors as problem details (RFC 9457), nothing that measures or stores.

Blocking calls stand in plain `def` routes, which the server runs beside its event loop.
"""

from grabberd.api.app import create_app

__all__ = ["create_app"]
