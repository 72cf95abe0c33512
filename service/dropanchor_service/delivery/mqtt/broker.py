"""The connection to the MQTT broker of the settings. This needs paho-mqtt."""

import asyncio
import ssl
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager
from typing import Any, NamedTuple

from paho.mqtt.client import Client
from paho.mqtt.enums import CallbackAPIVersion, MQTTErrorCode, MQTTProtocolVersion
from paho.mqtt.packettypes import PacketTypes
from paho.mqtt.properties import Properties
from paho.mqtt.reasoncodes import ReasonCode

from dropanchor_service.delivery.addresses import RefusedAddressError, allowed, is_told
from dropanchor_service.delivery.channel import ChannelError, Outcome, Verdict, password_in
from dropanchor_service.delivery.public_addresses import Network
from dropanchor_service.settings.events import MqttSettings

AT_ONCE = 256  # messages of one destination, each about another tag, and of all destinations together
KEEP_ALIVE_S = 30
QOS = 1
ONLINE, OFFLINE = b"online", b"offline"
_VERSIONS = {"5": MQTTProtocolVersion.MQTTv5, "3.1.1": MQTTProtocolVersion.MQTTv311}
_TRY_LATER = ("Quota exceeded",)


class Message(NamedTuple):
    """is_retained: whether the broker keeps it for those who subscribe later."""

    topic: str
    payload: bytes
    content_type: str = "application/json"
    is_retained: bool = False


class Access(NamedTuple):
    """How to reach the broker.

    status: the topic that says whether there is a connection, also after it broke; None: no topic does.
    """

    settings: MqttSettings
    tls: ssl.SSLContext
    timeout_s: float
    allow_networks: Sequence[Network]
    status: str | None = None


class BrokerGoneError(Exception):
    """The connection to the broker ended, or could not be made. The message says why."""


class Connection:
    """A connection to the broker. The event loop owns it; paho's thread only passes on what comes."""

    def __init__(self, access: Access) -> None:
        """Raises ChannelError when the password cannot be read."""
        settings, self._access = access.settings, access
        self._loop = asyncio.get_running_loop()
        self._connected: asyncio.Future[None] = self._loop.create_future()
        self._answers: dict[int, asyncio.Future[ReasonCode]] = {}
        self.has_ended = False
        self._client = Client(
            CallbackAPIVersion.VERSION2, protocol=_VERSIONS[settings.version], reconnect_on_failure=False
        )
        self._client.connect_timeout = access.timeout_s
        if access.status is not None:
            self._client.will_set(access.status, OFFLINE, QOS, retain=True)
        self._client.on_socket_open = lambda _client, _data, connection: self._check(connection)
        if settings.user is not None and settings.password_file is not None:
            self._client.username_pw_set(settings.user, password_in(settings.password_file))
        if settings.tls:
            self._client.tls_set_context(access.tls)
        self._client.on_connect = lambda _client, _data, _flags, reason, _properties: self._pass(self._greeted, reason)
        self._client.on_disconnect = lambda _client, _data, _flags, reason, _properties: self._pass(self._ended, reason)
        self._client.on_publish = lambda _client, _data, number, reason, _properties: self._pass(
            self._answered, number, reason
        )

    async def open(self) -> None:
        """Connect. Raises BrokerGoneError."""
        settings = self._access.settings
        host, port = settings.server or "", settings.port or (8883 if settings.tls else 1883)
        try:
            await asyncio.to_thread(self._client.connect, host, port, KEEP_ALIVE_S)
        except (OSError, ValueError) as error:
            raise BrokerGoneError(f"the broker {host}:{port} cannot be reached: {error}") from error
        self._client.loop_start()
        await self._connected
        self._tell(ONLINE)

    def _tell(self, status: bytes) -> None:
        if self._access.status is not None:
            self._client.publish(self._access.status, status, QOS, retain=True)

    def _check(self, connection: Any) -> None:
        """Close the connection before anything is sent to a refused address. Raises RefusedAddressError."""
        try:
            if not is_told(self._access.settings.server or ""):
                allowed([str(connection.getpeername()[0])], self._access.allow_networks)
        except RefusedAddressError:
            connection.close()
            raise

    async def close(self) -> None:
        self._tell(OFFLINE)
        self._client.disconnect()
        await asyncio.to_thread(self._client.loop_stop)
        self._ended(None)

    async def publish(self, message: Message) -> ReasonCode:
        """Publish a message, and return what the broker answered. Raises BrokerGoneError."""
        properties = Properties(PacketTypes.PUBLISH)
        properties.ContentType = message.content_type  # which MQTT 3.1.1 leaves out
        sent = self._client.publish(message.topic, message.payload, QOS, message.is_retained, properties)
        if sent.rc is not MQTTErrorCode.MQTT_ERR_SUCCESS:
            raise BrokerGoneError("the connection to the broker is broken")
        # The answer cannot come before this line: paho's thread passes it on through this event loop.
        answer: asyncio.Future[ReasonCode] = self._loop.create_future()
        self._answers[sent.mid] = answer
        return await answer

    def _pass(self, handle: Callable[..., None], *values: object) -> None:
        self._loop.call_soon_threadsafe(handle, *values)

    def _greeted(self, reason: ReasonCode) -> None:
        if self._connected.done():
            return
        if reason.is_failure:
            self._connected.set_exception(BrokerGoneError(f"the broker refuses the connection: {reason}"))
        else:
            self._connected.set_result(None)

    def _answered(self, number: int, reason: ReasonCode) -> None:
        answer = self._answers.pop(number, None)
        if answer is not None and not answer.done():
            answer.set_result(reason)

    def _ended(self, reason: ReasonCode | None) -> None:
        self.has_ended = True
        why = "was closed" if reason is None else f"was ended by the broker: {reason}"
        waiting: list[asyncio.Future[Any]] = [self._connected, *self._answers.values()]
        for future in waiting:
            if not future.done():
                future.set_exception(BrokerGoneError(f"the connection {why}"))
                future.exception()  # nobody may wait for it any longer
        self._answers.clear()


class Broker:
    """The connection that all channels of an event loop share: paho has a thread for each connection.

    It is made with the first message, and again after a failure. users: channels that are open. connections: how often
    it was made: a broker may have forgotten then what it kept.
    """

    def __init__(self, access: Access) -> None:
        self._access = access
        self._opening: asyncio.Task[Connection] | None = None
        self._connection: Connection | None = None
        self._room = asyncio.Semaphore(AT_ONCE)
        self.users = 0
        self.connections = 0

    async def send(self, messages: Sequence[Message]) -> Sequence[Outcome]:
        """Publish messages, and return the outcome of each."""
        try:
            connection = await self._connected()
        except TimeoutError:
            return [self._late()] * len(messages)
        except (BrokerGoneError, ChannelError) as error:
            return [Outcome(Verdict.UNAVAILABLE, str(error))] * len(messages)
        outcomes = await asyncio.gather(*(self._publish(connection, message) for message in messages))
        if any(outcome.verdict is Verdict.UNAVAILABLE for outcome in outcomes):
            await self._drop(connection)
        return outcomes

    async def _publish(self, connection: Connection, message: Message) -> Outcome:
        try:
            async with self._room, asyncio.timeout(self._access.timeout_s):
                reason = await connection.publish(message)
        except TimeoutError:
            return self._late()
        except (BrokerGoneError, ValueError) as error:
            return Outcome(Verdict.UNAVAILABLE, str(error))
        detail = f"the broker answered: {reason}"
        if not reason.is_failure:
            return Outcome(Verdict.ACCEPTED, detail)
        return Outcome(Verdict.UNAVAILABLE if str(reason) in _TRY_LATER else Verdict.REFUSED, detail)

    def _late(self) -> Outcome:
        return Outcome(Verdict.UNAVAILABLE, f"the broker did not answer within {self._access.timeout_s:g} s")

    async def _connected(self) -> Connection:
        """Return the open connection. All who wait for it learn of a failure.

        Raises BrokerGoneError, ChannelError and TimeoutError.
        """
        if self._connection is not None and self._connection.has_ended:
            await self._drop(self._connection)
        if self._opening is None:
            self._opening = asyncio.create_task(self._open())
        opening = self._opening
        try:
            return await asyncio.shield(opening)
        except (BrokerGoneError, ChannelError, TimeoutError):
            if self._opening is opening:
                self._opening = None
            raise

    async def _open(self) -> Connection:
        connection = Connection(self._access)
        try:
            async with asyncio.timeout(self._access.timeout_s):
                await connection.open()
        except BaseException:
            await connection.close()
            raise
        self._connection = connection
        self.connections += 1
        return connection

    async def _drop(self, connection: Connection | None) -> None:
        """Close a connection that has failed, unless somebody has done so."""
        if connection is not None and connection is self._connection:
            self._connection = self._opening = None
            await connection.close()

    async def close(self) -> None:
        if self._opening is not None:
            self._opening.cancel()
            await asyncio.wait([self._opening])
        await self._drop(self._connection)


class Brokers:
    """The connections of each event loop in which there is a channel: the thread that delivers, and that of requests.

    All events of a loop share one. A status needs its own, because the broker publishes its last will.
    """

    def __init__(self) -> None:
        self._opened: dict[tuple[asyncio.AbstractEventLoop, str | None], Broker] = {}

    @asynccontextmanager
    async def of_this_loop(self, access: Access) -> AsyncIterator[Broker]:
        name = asyncio.get_running_loop(), access.status
        broker = self._opened.setdefault(name, Broker(access))
        broker.users += 1
        try:
            yield broker
        finally:
            broker.users -= 1
            if not broker.users:
                del self._opened[name]
                await broker.close()
