"""The gate alone, over an application that says what has come through."""

from pathlib import Path
from typing import Any

from fastapi.testclient import TestClient
from starlette.requests import Request
from starlette.responses import JSONResponse
from starlette.types import Receive, Scope, Send
from starlette.websockets import WebSocket

from grabberd.archive.access import Access
from grabberd.documents.enums import Role
from grabberd.server.api.guard.authentication import Attempts, Authenticator
from grabberd.server.api.guard.front import Front
from grabberd.server.api.guard.gate import Gate


class Ticks:
    """A monotonic clock that goes when it is told to."""

    def __init__(self) -> None:
        self.now_s = 1000.0

    def __call__(self) -> float:
        return self.now_s


async def inside(scope: Scope, receive: Receive, send: Send) -> None:
    """Answers with who has come through, and how much they brought."""
    identity = scope.get("state", {}).get("identity")
    who = {"role": identity and identity.role, "by": identity and identity.by}
    if scope["type"] == "websocket":
        socket = WebSocket(scope, receive, send)
        await socket.accept()
        await socket.send_json(who)
        await socket.close()
        return
    body = await Request(scope, receive).body()
    await JSONResponse({**who, "bytes": len(body)})(scope, receive, send)


class Gated:
    """A gate with its tokens: `secrets` by role, where there are any; `address` where it is served."""

    def __init__(self, folder: Path, tokens: bool = True, front: Front | None = None, app: Any = inside):
        self.access = Access(folder)
        self.access.open()
        self.secrets = {role: self.access.add(role.value, role) for role in Role} if tokens else {}
        self.address = ("", 0)
        self.clock = Ticks()
        self.front = front or Front()
        authenticator = Authenticator(self.access, self.front.private, Attempts(self.clock))
        self.app = Gate(app, self.front, authenticator, self.clock)

    def client(self, **options: Any) -> TestClient:
        return TestClient(self.app, "http://localhost:8050", **options)

    def bearer(self, role: Role) -> dict[str, str]:
        return {"Authorization": f"Bearer {self.secrets[role]}"}


def is_problem(answer: Any, status: int, name: str) -> bool:
    kind = answer.headers["content-type"] == "application/problem+json"
    found = answer.json()
    return bool(
        answer.status_code == status == found["status"]
        and kind
        and found["hint"]
        and found["type"].endswith(f":{name}")
    )
