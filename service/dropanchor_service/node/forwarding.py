"""Ask the owner of a bucket, and its successor if it does not answer."""

import asyncio
import logging
from collections.abc import AsyncIterator, Awaitable, Callable
from dataclasses import dataclass
from typing import Any, TypeVar

import httpx

from dropanchor_schemas.sentences import said_by
from dropanchor_service.api.http.errors import Kind, ProblemError
from dropanchor_service.api.http.of_cluster import epoch_in
from dropanchor_service.metrics.node import NodeMetrics
from dropanchor_service.node import sentences
from dropanchor_service.node.links import Links
from dropanchor_service.node.owners import Owner, Owners
from dropanchor_service.node.request import Asked, ClientGoneError

PAUSE_S = 0.05
T = TypeVar("T")

_log = logging.getLogger(__name__)


class MissedError(Exception):
    """The owner did not answer. did_not_arrive: the request certainly did not reach an owner."""

    def __init__(self, sentence: str, did_not_arrive: bool = False) -> None:
        super().__init__(sentence)
        self.did_not_arrive = did_not_arrive


class FollowedError(Exception):
    """The bucket has an owner with a higher epoch now."""


@dataclass(frozen=True)
class Answer:
    """An owner's answer, whose body is still to come. Close it."""

    owner: Owner
    response: httpx.Response

    async def chunks(self) -> AsyncIterator[bytes]:
        """Yield the body. Raises httpx.TransportError when the owner is gone before its end."""
        assert isinstance(self.response.stream, httpx.AsyncByteStream)
        async for chunk in self.response.stream:
            yield chunk

    async def close(self) -> None:
        await self.response.aclose()


class Forwarding:
    """Asks owners. look: called when one does not answer, so that the table of leases is read soon."""

    def __init__(self, owners: Owners, links: Links, metrics: NodeMetrics, look: Callable[[], None]) -> None:
        self._owners = owners
        self._links = links
        self._metrics = metrics
        self._look = look

    async def ask(self, bucket: str, asked: Asked) -> Answer:
        """Return the answer of the owner of a bucket. Raises ProblemError, with a sentence, when it has none.

        What changes nothing, or did not arrive, is sent again while a successor may be about to serve.
        """
        while True:
            try:
                return await self._ask_once(self._known(bucket), asked)
            except MissedError as missed:
                self._look()
                may_repeat = asked.body.can_repeat and (asked.is_safe or missed.did_not_arrive)
                if not may_repeat or not self._owners.is_worth_waiting(bucket):
                    raise ProblemError(Kind.NOT_READY, said_by(missed)) from missed
            self._metrics.repeated.inc()
            await self._links.forget_former()
            await asyncio.sleep(PAUSE_S)

    def owner(self, bucket: str) -> Owner:
        """Return the owner of a bucket. Raises ProblemError."""
        try:
            return self._known(bucket)
        except MissedError as missed:
            self._look()
            raise ProblemError(Kind.NOT_READY, said_by(missed)) from missed

    def _known(self, bucket: str) -> Owner:
        owner = self._owners.of(bucket)
        if owner is None or not owner.name:
            raise MissedError(sentences.without_owner(bucket), True)
        if not owner.address:
            raise MissedError(sentences.without_address(owner), True)
        return owner

    async def _ask_once(self, owner: Owner, asked: Asked) -> Answer:
        try:
            response = await while_newest(self._links.ask(owner, asked), self._owners.followed(owner))
        except FollowedError as error:
            raise MissedError(sentences.former(owner)) from error
        except (httpx.ConnectError, httpx.ConnectTimeout) as error:
            raise MissedError(sentences.unreachable(owner), did_not_arrive=True) from error
        except httpx.TransportError as error:
            raise MissedError(sentences.cut_short(owner)) from error
        try:
            return Answer(self._answering(owner, response), response)
        except MissedError:
            await response.aclose()
            raise

    def _answering(self, owner: Owner, response: httpx.Response) -> Owner:
        """Return who answers. Raises MissedError if it is not the newest owner that was seen."""
        epoch = epoch_in(response.headers, owner.bucket)
        if epoch is None:
            is_standby = response.status_code == Kind.NOT_READY.status
            raise MissedError(sentences.silent(owner), did_not_arrive=is_standby)
        answering = self._owners.accepted(owner, epoch)
        if answering is None:
            self._metrics.dropped.inc()
            _log.warning("dropped an answer of %s with the former epoch %d of %s", owner.name, epoch, owner.bucket)
            raise MissedError(sentences.former(owner))
        return answering


async def while_newest(work: Awaitable[T], followed: "asyncio.Future[None]") -> T:
    """Return what `work` returns. Cancel it and raise FollowedError once its owner has a successor."""
    task = asyncio.ensure_future(work)
    either: set[asyncio.Future[Any]] = {task, followed}
    try:
        await asyncio.wait(either, return_when=asyncio.FIRST_COMPLETED)
        if not task.done():
            raise FollowedError
        return task.result()
    finally:
        if not task.done():
            task.cancel()
            await asyncio.wait({task})


async def while_connected(work: Awaitable[None], gone: Awaitable[None]) -> None:
    """Wait for `work`. Cancel it, and raise ClientGoneError, once the client is gone."""
    task, watch = asyncio.ensure_future(work), asyncio.ensure_future(gone)
    try:
        await asyncio.wait({task, watch}, return_when=asyncio.FIRST_COMPLETED)
        if not task.done():
            raise ClientGoneError
        task.result()
    finally:
        for each in (task, watch):
            if not each.done():
                each.cancel()
                await asyncio.wait({each})
