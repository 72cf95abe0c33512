"""The connection to an MQTT broker, with sentences for what goes wrong."""

import socket
import ssl
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from queue import Empty, SimpleQueue
from typing import Any, NamedTuple
from urllib.parse import urlsplit

from paho.mqtt.client import Client, MQTTMessage
from paho.mqtt.enums import CallbackAPIVersion

from dropanchor_tag_client.reminders import Reminders
from dropanchor_tag_client.sources.bridge.measurement import Received

_PORTS = {"mqtt": 1883, "mqtts": 8883, "ws": 80, "wss": 443}
_QUEUE_MESSAGES = 10_000
_KEEP_ALIVE_S, _RETRY_S, _MAX_RETRY_S = 30, 1, 10


class BrokerError(ValueError):
    """The broker cannot be used as it was named."""


class BrokerSettings(NamedTuple):
    """url: mqtt://host:port, mqtts:// (TLS), ws:// or wss:// (WebSocket); a host alone means mqtt://.

    ca, cert, key: PEM files for TLS; without ca, the certificates that the system trusts.
    """

    url: str
    user: str | None = None
    password: str | None = None
    ca: str | None = None
    cert: str | None = None
    key: str | None = None

    def address(self) -> tuple[str, str, int, str]:
        """Return scheme, host, port and path of the URL. Raises BrokerError."""
        try:
            parts = urlsplit(self.url if "://" in self.url else f"mqtt://{self.url}")
            port = parts.port
        except ValueError as error:
            raise BrokerError(f"the broker is {self.url!r}: {error}") from error
        if parts.scheme not in _PORTS or not parts.hostname:
            raise BrokerError(f"the broker is {self.url!r}; mqtt://host:1883 or mqtts://host:8883 was expected")
        if parts.scheme in ("mqtt", "ws") and (self.ca or self.cert):
            raise BrokerError(f"certificates are given, but {self.url} is not an mqtts:// or wss:// address")
        return parts.scheme, parts.hostname, port or _PORTS[parts.scheme], parts.path


class Broker:
    """Messages of the subscribed topics. lost: number of messages that nobody took in time."""

    def __init__(self, settings: BrokerSettings, topics: tuple[str, ...], say: Callable[[str], None]) -> None:
        self.lost = 0
        self._url = settings.url
        self._topics = topics
        self._say = say
        self._queue: SimpleQueue[Received] = SimpleQueue()
        self._scheme, self._host, self._port, path = settings.address()
        self._client = _client(settings, self._scheme, path)
        self._client.on_connect = self._on_connect
        self._client.on_subscribe = self._on_subscribe
        self._client.on_disconnect = self._on_disconnect
        self._client.on_message = self._on_message

    @contextmanager
    def connected(self) -> Iterator[None]:
        """Stay connected until the block ends. Say what is wrong while the broker cannot be reached."""
        try:
            self._connect()
            self._client.loop_start()
            yield
        finally:
            self._client.disconnect()
            self._client.loop_stop()

    def receive(self) -> Received | None:
        """Return the next message, None if none waits."""
        try:
            return self._queue.get_nowait()
        except Empty:
            return None

    def _connect(self) -> None:
        retry_s, reminders = _RETRY_S, Reminders()
        while True:
            try:
                self._client.connect(self._host, self._port, _KEEP_ALIVE_S)
                return
            except (OSError, ValueError) as error:
                if reminders.failed():
                    self._say(f"{self._url}: {_what_to_do(error)} {reminders.words}.")
            time.sleep(retry_s)
            retry_s = min(2 * retry_s, _MAX_RETRY_S)

    def _on_connect(self, client: Client, _data: Any, _flags: Any, reason: Any, _properties: Any) -> None:
        if reason.is_failure:
            self._say(f"{self._url} refuses this client: {reason}. Check --mqtt-user and the password.")
            return
        client.subscribe([(topic, 1) for topic in self._topics])

    def _on_subscribe(self, _client: Client, _data: Any, _id: int, reasons: list[Any], _properties: Any) -> None:
        refused = [topic for topic, reason in zip(self._topics, reasons, strict=False) if reason.is_failure]
        if refused:
            self._say(f"{self._url} refuses to send {', '.join(refused)}: check the rights of --mqtt-user")
        else:
            self._say(f"{self._url}: connected; waiting for {', '.join(self._topics)}")

    def _on_disconnect(self, _client: Client, _data: Any, _flags: Any, reason: Any, _properties: Any) -> None:
        if reason.is_failure:
            self._say(f"{self._url}: the connection broke ({reason}). Trying again until it is back.")

    def _on_message(self, _client: Client, _data: Any, message: MQTTMessage) -> None:
        if self._queue.qsize() < _QUEUE_MESSAGES:  # only this thread puts
            self._queue.put(Received(message.topic, bytes(message.payload), time.time_ns(), bool(message.retain)))
        else:
            self.lost += 1


def _client(settings: BrokerSettings, scheme: str, path: str) -> Client:
    client = Client(CallbackAPIVersion.VERSION2, transport="websockets" if scheme.startswith("ws") else "tcp")
    client.reconnect_delay_set(_RETRY_S, _MAX_RETRY_S)
    if settings.user is not None:
        client.username_pw_set(settings.user, settings.password)
    if scheme.startswith("ws"):
        client.ws_set_options(path or "/mqtt")
    if scheme in ("mqtts", "wss"):
        try:
            client.tls_set(settings.ca, settings.cert, settings.key)
        except (OSError, ValueError) as error:
            raise BrokerError(f"the certificates cannot be used: {error}") from error
    return client


def _what_to_do(error: Exception) -> str:
    match error:
        case ssl.SSLCertVerificationError():
            return f"its certificate is not trusted ({error.verify_message}): --mqtt-ca names the authority's."
        case ssl.SSLError():
            return f"TLS failed ({error.reason}): is the port one for TLS, and does it want --mqtt-cert?"
        case socket.gaierror():
            return "there is no host of that name."
        case ConnectionRefusedError():
            return "no broker listens there: check address and port."
    return f"it cannot be reached: {error}."
