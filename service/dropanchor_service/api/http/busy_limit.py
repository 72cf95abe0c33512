"""Leave connections for health checks while streams and slow requests hold the others."""

from starlette.requests import Request
from starlette.types import ASGIApp, Receive, Scope, Send

from dropanchor_schemas.sentences import say
from dropanchor_service.api.http.errors import Kind, problem_response

SHARE = 0.75  # of the connections, for streams and requests other than these
ALWAYS = ("/health/live", "/health/ready", "/metrics")


class BusyLimit:
    """ASGI middleware that answers 503 while too many requests and streams are open, except to health checks."""

    def __init__(self, app: ASGIApp, limit: int) -> None:
        self._app = app
        self._limit = max(1, int(SHARE * limit))
        self._open = 0

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "lifespan" or scope["path"].endswith(ALWAYS):
            await self._app(scope, receive, send)
        elif self._open < self._limit:
            self._open += 1
            try:
                await self._app(scope, receive, send)
            finally:
                self._open -= 1
        elif scope["type"] == "http":
            detail = say(
                "busy", "{n} requests and streams are open, which is the limit. Try again later.", n=self._limit
            )
            await problem_response(Request(scope), Kind.BUSY, detail)(scope, receive, send)
        else:
            await send({"type": "websocket.close", "code": 1013})
