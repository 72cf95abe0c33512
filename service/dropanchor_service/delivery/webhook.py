"""Deliver events to a webhook: one signed POST for each."""

import asyncio
import ssl
import time
from collections.abc import AsyncIterator, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import asynccontextmanager
from dataclasses import dataclass
from typing import ClassVar

import httpx
import orjson

from dropanchor_schemas.destinations import WebhookDestination
from dropanchor_service.delivery.addresses import UrlError, allowed, checked_url, resolved
from dropanchor_service.delivery.channel import Outcome, Portion, Verdict
from dropanchor_service.delivery.public_addresses import Network
from dropanchor_service.delivery.signature import headers

CONTENT_TYPE = "application/cloudevents+json; charset=utf-8"
AT_ONCE = 32  # requests, each about another tag
_TRY_LATER = (408, 425, 429)
_MAX_ANSWER = 200


@dataclass(frozen=True)
class WebhookChannel:
    """Posts events to allowed addresses only.

    lookups: a thread of its own, since a name whose server does not answer holds one for half a minute.
    """

    webhook: WebhookDestination
    client: httpx.AsyncClient
    lookups: ThreadPoolExecutor
    timeout_s: float
    allow_networks: Iterable[Network]
    portion: ClassVar[Portion] = Portion(AT_ONCE)

    async def send(self, events: Sequence[bytes]) -> Sequence[Outcome]:
        return await asyncio.gather(*map(self._send, events))

    async def _send(self, event: bytes) -> Outcome:
        try:
            async with asyncio.timeout(self.timeout_s):
                return await self._post(event)
        except TimeoutError:
            return Outcome(Verdict.UNAVAILABLE, f"there was no answer within {self.timeout_s:g} s")
        except UrlError as error:
            return Outcome(Verdict.UNAVAILABLE, str(error))
        except (httpx.HTTPError, OSError) as error:
            return Outcome(Verdict.UNAVAILABLE, f"{type(error).__name__}: {error}")

    async def _post(self, event: bytes) -> Outcome:
        url = checked_url(self.webhook.url)
        found = await asyncio.get_running_loop().run_in_executor(self.lookups, resolved, url)
        address = allowed(found, self.allow_networks)
        assert self.webhook.secret is not None
        request = self.client.build_request(
            "POST",
            url.copy_with(host=address),
            content=event,
            headers={
                "host": url.netloc.decode("ascii"),
                "content-type": CONTENT_TYPE,
                "user-agent": "dropanchor",
                **headers(self.webhook.secret, orjson.loads(event)["id"], int(time.time()), event),
            },
            extensions={"sni_hostname": url.host},
        )
        response = await self.client.send(request, stream=True)  # of the answer, the status is enough
        await response.aclose()
        return _judged(response)


@asynccontextmanager
async def open_webhook(
    webhook: WebhookDestination, tls: ssl.SSLContext, timeout_s: float, allow_networks: Iterable[Network]
) -> AsyncIterator[WebhookChannel]:
    """Open the way to a webhook. It follows no redirects and no proxy settings."""
    lookups = ThreadPoolExecutor(1, "webhook")
    try:
        async with httpx.AsyncClient(verify=tls, timeout=timeout_s, follow_redirects=False, trust_env=False) as client:
            yield WebhookChannel(webhook, client, lookups, timeout_s, allow_networks)
    finally:
        lookups.shutdown(wait=False, cancel_futures=True)


def _judged(response: httpx.Response) -> Outcome:
    detail = f"the receiver answered {response.status_code} {response.reason_phrase[:_MAX_ANSWER]}".strip()
    if response.is_success:
        return Outcome(Verdict.ACCEPTED, detail)
    later = response.is_server_error or response.status_code in _TRY_LATER
    return Outcome(Verdict.UNAVAILABLE if later else Verdict.REFUSED, detail)
