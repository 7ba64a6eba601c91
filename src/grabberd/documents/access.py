"""Identity of a client."""

from typing import Literal

from pydantic import Field

from grabberd.documents.document import Document, with_examples
from grabberd.documents.roles import Role


class SessionDocument(Document):
    """Identity and role of the client; on the machine itself a token may not be needed."""

    model_config = with_examples(
        {"role": "operator", "by": "session", "token": "tablet-north", "expires_utc": None}
    )

    role: Role
    by: Literal["token", "session", "socket", "machine"]
    token: str | None = Field(description="Name of the token.")
    expires_utc: str | None = Field(description="Expiry of the token; null: valid until it is removed.")
