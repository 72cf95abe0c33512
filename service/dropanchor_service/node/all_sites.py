"""Join the answers of all owners about all of their sites. Their JSON is spliced, not parsed."""

import asyncio
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import httpx

from dropanchor_schemas.sentences import say
from dropanchor_service.api.http.errors import Kind, ProblemError
from dropanchor_service.node.forwarding import Forwarding
from dropanchor_service.node.request import Asked, RawHeaders

PATIENCE_S = 10.0
_BEGIN, _END = b'{"sites":[', b"]}"


@dataclass(frozen=True)
class Part:
    """The answer of one owner. body: None when there is none."""

    bucket: str
    status: int = 0
    headers: RawHeaders | None = None
    body: bytes | None = None
    why_not: str = ""

    @property
    def sites(self) -> memoryview | None:
        """The sites in the body, without what is around them; None where the body has another form."""
        body = self.body or b""
        fits = self.status == 200 and body.startswith(_BEGIN) and body.endswith(_END)
        return memoryview(body)[len(_BEGIN) : -len(_END)] if fits else None

    @property
    def is_refusal(self) -> bool:
        """Whether the owner answers, but not to this client or not this request. The others say the same."""
        return 400 <= self.status < 500


async def parts_of(forwarding: Forwarding, buckets: Sequence[str], asked: Asked) -> list[Part]:
    """Ask the owner of every bucket at once."""
    return list(await asyncio.gather(*(_part(forwarding, bucket, asked) for bucket in buckets)))


async def _part(forwarding: Forwarding, bucket: str, asked: Asked) -> Part:
    try:
        async with asyncio.timeout(PATIENCE_S):
            answer = await forwarding.ask(bucket, asked)
            try:
                body = b"".join([chunk async for chunk in answer.chunks()])
            finally:
                await answer.close()
    except ProblemError as error:
        return Part(bucket, why_not=error.detail)
    except (httpx.TransportError, TimeoutError):
        return Part(
            bucket, why_not=say("owner_incomplete", "The owner of {bucket} did not complete its answer.", bucket=bucket)
        )
    return Part(bucket, answer.response.status_code, answer.response.headers.raw, body)


def refusal_of(parts: Sequence[Part]) -> Part | None:
    """Return what an owner refuses, None if none does."""
    return next((part for part in parts if part.is_refusal), None)


def joined(parts: Sequence[Part]) -> Iterator[bytes | memoryview]:
    """Yield one answer of all parts. It names the buckets whose sites are missing. Raises ProblemError if all are."""
    found = [(part.bucket, part.sites) for part in parts]
    missing = [bucket for bucket, sites in found if sites is None]
    if len(missing) == len(found):
        why_not = [part.why_not for part in parts if part.why_not] or [say("no_owner_answers", "No owner answers.")]
        raise ProblemError(Kind.NOT_READY, why_not[0] if len(why_not) == 1 else " ".join(why_not))
    between = _BEGIN
    for sites in (sites for _, sites in found if sites):
        yield between
        yield sites
        between = b","
    if between == _BEGIN:
        yield _BEGIN
    yield b"]" + (b',"unavailable":' + json.dumps(missing).encode() if missing else b"") + b"}"
