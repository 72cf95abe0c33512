"""Deliver events to a topic of an MQTT broker: one message (QoS 1) for each. This needs paho-mqtt."""

import asyncio
import ssl
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager
from typing import Any

import orjson
from paho.mqtt.client import Client
from paho.mqtt.enums import CallbackAPIVersion, MQTTErrorCode, MQTTProtocolVersion
from paho.mqtt.packettypes import PacketTypes
from paho.mqtt.properties import Properties
from paho.mqtt.reasoncodes import ReasonCode

from dropanchor_schemas.destinations import MqttDestination
from dropanchor_schemas.keys import chunk_from_id
from dropanchor_service.delivery.addresses import RefusedAddressError, allowed, is_told
from dropanchor_service.delivery.channel import ChannelError, Outcome, Portion, Verdict, password_in
from dropanchor_service.delivery.public_addresses import Network
from dropanchor_service.delivery.sentences import SOURCE_PREFIX
from dropanchor_service.settings.events import MqttSettings

CONTENT_TYPE = "application/cloudevents+json; charset=utf-8"
AT_ONCE = 256  # messages of one destination, each about another tag, and of all destinations together
KEEP_ALIVE_S = 30
QOS = 1
_TRY_LATER = ("Quota exceeded",)


class BrokerGoneError(Exception):
    """The connection to the broker ended, or could not be made. The message says why."""


class Connection:
    """A connection to the broker. The event loop owns it; paho's thread only passes on what comes."""

    def __init__(
        self, settings: MqttSettings, tls: ssl.SSLContext, timeout_s: float, allow_networks: Sequence[Network]
    ) -> None:
        """Raises ChannelError when the password cannot be read."""
        self._settings = settings
        self._allow_networks = allow_networks
        self._loop = asyncio.get_running_loop()
        self._connected: asyncio.Future[None] = self._loop.create_future()
        self._answers: dict[int, asyncio.Future[ReasonCode]] = {}
        self._client = Client(
            CallbackAPIVersion.VERSION2, protocol=MQTTProtocolVersion.MQTTv5, reconnect_on_failure=False
        )
        self._client.connect_timeout = timeout_s
        self._client.on_socket_open = lambda _client, _data, connection: self._check(connection)
        if settings.user is not None and settings.password_file is not None:
            self._client.username_pw_set(settings.user, password_in(settings.password_file))
        if settings.tls:
            self._client.tls_set_context(tls)
        self._client.on_connect = lambda _client, _data, _flags, reason, _properties: self._pass(self._greeted, reason)
        self._client.on_disconnect = lambda _client, _data, _flags, reason, _properties: self._pass(self._ended, reason)
        self._client.on_publish = lambda _client, _data, number, reason, _properties: self._pass(
            self._answered, number, reason
        )

    async def open(self) -> None:
        """Connect. Raises BrokerGoneError."""
        host, port = self._settings.server or "", self._settings.port or (8883 if self._settings.tls else 1883)
        try:
            await asyncio.to_thread(self._client.connect, host, port, KEEP_ALIVE_S)
        except (OSError, ValueError) as error:
            raise BrokerGoneError(f"the broker {host}:{port} cannot be reached: {error}") from error
        self._client.loop_start()
        await self._connected

    def _check(self, connection: Any) -> None:
        """Close the connection before anything is sent to a refused address. Raises RefusedAddressError."""
        try:
            if not is_told(self._settings.server or ""):
                allowed([str(connection.getpeername()[0])], self._allow_networks)
        except RefusedAddressError:
            connection.close()
            raise

    async def close(self) -> None:
        self._client.disconnect()
        await asyncio.to_thread(self._client.loop_stop)
        self._ended(None)

    async def publish(self, topic: str, payload: bytes) -> ReasonCode:
        """Publish a message, and return what the broker answered. Raises BrokerGoneError."""
        properties = Properties(PacketTypes.PUBLISH)
        properties.ContentType = CONTENT_TYPE
        sent = self._client.publish(topic, payload, QOS, properties=properties)
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
        why = "was closed" if reason is None else f"was ended by the broker: {reason}"
        waiting: list[asyncio.Future[Any]] = [self._connected, *self._answers.values()]
        for future in waiting:
            if not future.done():
                future.set_exception(BrokerGoneError(f"the connection {why}"))
                future.exception()  # nobody may wait for it any longer
        self._answers.clear()


class Broker:
    """The connection that all channels of an event loop share: paho has a thread for each connection.

    It is made with the first event, and again after a failure. users: channels that are open. room: for messages that
    wait for their answer.
    """

    def __init__(
        self, settings: MqttSettings, tls: ssl.SSLContext, timeout_s: float, allow_networks: Sequence[Network]
    ) -> None:
        self._settings = settings
        self._tls = tls
        self._allow_networks = allow_networks
        self._opening: asyncio.Task[Connection] | None = None
        self._connection: Connection | None = None
        self.timeout_s = timeout_s
        self.users = 0
        self.room = asyncio.Semaphore(AT_ONCE)

    async def connection(self) -> Connection:
        """Return the open connection. All who wait for it learn of a failure.

        Raises BrokerGoneError, ChannelError and TimeoutError.
        """
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
        connection = Connection(self._settings, self._tls, self.timeout_s, self._allow_networks)
        try:
            async with asyncio.timeout(self.timeout_s):
                await connection.open()
        except BaseException:
            await connection.close()
            raise
        self._connection = connection
        return connection

    async def drop(self, connection: Connection | None) -> None:
        """Close a connection that has failed, unless somebody has done so."""
        if connection is not None and connection is self._connection:
            self._connection = self._opening = None
            await connection.close()

    async def close(self) -> None:
        if self._opening is not None:
            self._opening.cancel()
            await asyncio.wait([self._opening])
        await self.drop(self._connection)


class Brokers:
    """The connection of each event loop in which there is a channel: the thread that delivers, and that of requests."""

    def __init__(self) -> None:
        self._of_loops: dict[asyncio.AbstractEventLoop, Broker] = {}

    @asynccontextmanager
    async def of_this_loop(
        self, settings: MqttSettings, tls: ssl.SSLContext, timeout_s: float, allow_networks: Sequence[Network]
    ) -> AsyncIterator[Broker]:
        loop = asyncio.get_running_loop()
        broker = self._of_loops.setdefault(loop, Broker(settings, tls, timeout_s, allow_networks))
        broker.users += 1
        try:
            yield broker
        finally:
            broker.users -= 1
            if not broker.users:
                del self._of_loops[loop]
                await broker.close()


class MqttChannel:
    """Publishes the events of one destination."""

    portion = Portion(AT_ONCE)

    def __init__(self, destination: MqttDestination, broker: Broker) -> None:
        self._topic = destination.topic
        self._broker = broker

    async def send(self, events: Sequence[bytes]) -> Sequence[Outcome]:
        try:
            connection = await self._broker.connection()
        except TimeoutError:
            return [self._late()] * len(events)
        except (BrokerGoneError, ChannelError) as error:
            return [Outcome(Verdict.UNAVAILABLE, str(error))] * len(events)
        outcomes = await asyncio.gather(*(self._publish(connection, event) for event in events))
        if any(outcome.verdict is Verdict.UNAVAILABLE for outcome in outcomes):
            await self._broker.drop(connection)
        return outcomes

    async def _publish(self, connection: Connection, event: bytes) -> Outcome:
        try:
            async with self._broker.room, asyncio.timeout(self._broker.timeout_s):
                reason = await connection.publish(topic_of(self._topic, event), event)
        except TimeoutError:
            return self._late()
        except (BrokerGoneError, ValueError) as error:
            return Outcome(Verdict.UNAVAILABLE, str(error))
        detail = f"the broker answered: {reason}"
        if not reason.is_failure:
            return Outcome(Verdict.ACCEPTED, detail)
        return Outcome(Verdict.UNAVAILABLE if str(reason) in _TRY_LATER else Verdict.REFUSED, detail)

    def _late(self) -> Outcome:
        return Outcome(Verdict.UNAVAILABLE, f"the broker did not answer within {self._broker.timeout_s:g} s")


@asynccontextmanager
async def open_mqtt(
    destination: MqttDestination,
    settings: MqttSettings,
    tls: ssl.SSLContext,
    timeout_s: float,
    allow_networks: Sequence[Network],
    brokers: Brokers,
) -> AsyncIterator[MqttChannel]:
    """Open the way to a topic. The connection is made with the first event."""
    async with brokers.of_this_loop(settings, tls, timeout_s, allow_networks) as broker:
        yield MqttChannel(destination, broker)


def topic_of(template: str, event: bytes) -> str:
    """Return the topic of an event. What is not allowed in one level of a topic is percent-escaped."""
    parsed = orjson.loads(event)
    values = {"site": parsed["source"].removeprefix(SOURCE_PREFIX), "tag": parsed["subject"], "type": parsed["type"]}
    return template.format(**{name: chunk_from_id(value) for name, value in values.items()})
