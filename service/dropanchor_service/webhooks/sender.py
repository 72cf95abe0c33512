"""Send one event to one receiver."""

import asyncio
import time
from collections.abc import Sequence
from enum import Enum
from pathlib import Path
from typing import NamedTuple

import httpx
import orjson

from dropanchor_schemas.webhooks import Webhook
from dropanchor_service.webhooks.addresses import Network, UrlError, allowed, checked_url, resolved
from dropanchor_service.webhooks.signature import headers

CONTENT_TYPE = "application/cloudevents+json; charset=utf-8"
_TRY_LATER = (408, 425, 429)
_MAX_ANSWER = 200


class Verdict(Enum):
    """What became of a request. REFUSED is about this event; UNAVAILABLE is about the receiver."""

    ACCEPTED = 0
    REFUSED = 1
    UNAVAILABLE = 2


class Outcome(NamedTuple):
    verdict: Verdict
    detail: str


class Sender:
    """Sends events within a time limit, to allowed addresses only."""

    def __init__(self, timeout_s: float, allow_networks: Sequence[Network], authorities: Path | None = None) -> None:
        """authorities: certificates of authorities that are trusted beside the public ones.

        Raises OSError when the file cannot be read.
        """
        self.allow_networks = tuple(allow_networks)
        self._timeout_s = timeout_s
        self._tls = httpx.create_ssl_context(trust_env=False)
        if authorities is not None:
            self._tls.load_verify_locations(authorities)

    def client(self) -> httpx.AsyncClient:
        """Return a client for one URL. It follows no redirects and no proxy settings."""
        return httpx.AsyncClient(verify=self._tls, timeout=self._timeout_s, follow_redirects=False, trust_env=False)

    async def send(self, client: httpx.AsyncClient, webhook: Webhook, body: bytes) -> Outcome:
        """Post the event, a CloudEvent in JSON, and return what became of it."""
        try:
            async with asyncio.timeout(self._timeout_s):
                return await self._post(client, webhook, body)
        except TimeoutError:
            return Outcome(Verdict.UNAVAILABLE, f"there was no answer within {self._timeout_s:g} s")
        except UrlError as error:
            return Outcome(Verdict.UNAVAILABLE, str(error))
        except (httpx.HTTPError, OSError) as error:
            return Outcome(Verdict.UNAVAILABLE, f"{type(error).__name__}: {error}")

    async def _post(self, client: httpx.AsyncClient, webhook: Webhook, body: bytes) -> Outcome:
        url = checked_url(webhook.url)
        address = allowed(await asyncio.to_thread(resolved, url), self.allow_networks)
        assert webhook.secret is not None
        request = client.build_request(
            "POST",
            url.copy_with(host=address),
            content=body,
            headers={
                "host": url.netloc.decode("ascii"),
                "content-type": CONTENT_TYPE,
                "user-agent": "dropanchor",
                **headers(webhook.secret, orjson.loads(body)["id"], int(time.time()), body),
            },
            extensions={"sni_hostname": url.host},
        )
        response = await client.send(request, stream=True)  # of the answer, the status is enough
        await response.aclose()
        return _judged(response)


def _judged(response: httpx.Response) -> Outcome:
    detail = f"the receiver answered {response.status_code} {response.reason_phrase[:_MAX_ANSWER]}".strip()
    if response.is_success:
        return Outcome(Verdict.ACCEPTED, detail)
    later = response.is_server_error or response.status_code in _TRY_LATER
    return Outcome(Verdict.UNAVAILABLE if later else Verdict.REFUSED, detail)
