"""Open the way to a destination of any type, and refuse those to which nothing could be delivered."""

import importlib
import ssl
from contextlib import AbstractAsyncContextManager
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from dropanchor_schemas.destinations import Destination, EmailDestination, MqttDestination, WebhookDestination
from dropanchor_service.delivery.addresses import UrlError, allowed, checked_url, resolved
from dropanchor_service.delivery.channel import Channel, ChannelError, tls_context
from dropanchor_service.delivery.sentences import NameOf
from dropanchor_service.delivery.signature import SecretError, key_of
from dropanchor_service.settings.events import DeliverySettings, EmailSettings, MqttSettings

if TYPE_CHECKING:
    from dropanchor_service.delivery.mqtt import Brokers


class SharedWays:
    """What all sites share: TLS contexts and the connections to the MQTT broker.

    A context takes some 20 ms and memory, so only types in use have one. A library may change it, so each type has its
    own.
    """

    def __init__(self, authorities: Path | None) -> None:
        """authorities: PEM file. Raises OSError when it cannot be read."""
        self._authorities = authorities
        if authorities is not None:
            tls_context(authorities)  # a file that cannot be read is refused at the start

    @cached_property
    def webhook(self) -> ssl.SSLContext:
        return tls_context(self._authorities)

    @cached_property
    def email(self) -> ssl.SSLContext:
        return tls_context(self._authorities)

    @cached_property
    def mqtt(self) -> ssl.SSLContext:
        return tls_context(self._authorities)

    @cached_property
    def brokers(self) -> "Brokers":
        from dropanchor_service.delivery.mqtt import Brokers  # an extra

        return Brokers()


class Channels:
    """The ways to the destinations of one site, as the settings want them."""

    def __init__(
        self,
        delivery: DeliverySettings,
        email: EmailSettings,
        mqtt: MqttSettings,
        name_of: NameOf = str,
        shared: SharedWays | None = None,
    ) -> None:
        """name_of: by default, the id of the tag. shared: by all sites. Raises OSError; see `SharedWays`."""
        self._delivery = delivery
        self._email = email
        self._mqtt = mqtt
        self._name_of = name_of
        self._shared = shared or SharedWays(delivery.authorities)

    def open(self, destination: Destination) -> AbstractAsyncContextManager[Channel]:
        """Return the way to a destination as a context. It must have passed `check_settings`."""
        timeout_s = self._delivery.timeout_s
        match destination:
            case WebhookDestination():
                from dropanchor_service.delivery.webhook import open_webhook  # these libraries take memory

                return open_webhook(destination, self._shared.webhook, timeout_s, self._delivery.allow_networks)
            case EmailDestination():
                from dropanchor_service.delivery.mail import open_mail

                page, networks = self._delivery.page, self._delivery.allow_networks
                return open_mail(destination, self._email, self._shared.email, timeout_s, networks, page, self._name_of)
            case MqttDestination():
                from dropanchor_service.delivery.mqtt import open_mqtt  # an extra

                shared, networks = self._shared, self._delivery.allow_networks
                return open_mqtt(destination, self._mqtt, shared.mqtt, timeout_s, networks, shared.brokers)

    def check(self, destination: Destination) -> None:
        """Raise ChannelError when nothing could be delivered. It may resolve a name, and blocks then."""
        self.check_settings(destination)
        if isinstance(destination, WebhookDestination):
            self._check_webhook(destination)

    def check_settings(self, destination: Destination) -> None:
        """Raise ChannelError when the settings lack what the type of the destination needs."""
        match destination:
            case EmailDestination() if self._email.server is None:
                raise ChannelError("an e-mail needs a mail server: set `server` in `[email]` of the settings")
            case MqttDestination() if self._mqtt.server is None:
                raise ChannelError("MQTT needs a broker: set `server` in `[mqtt]` of the settings")
            case MqttDestination() if not _is_installed("paho.mqtt"):
                raise ChannelError("MQTT needs the extra `mqtt`: pip install 'dropanchor-service[mqtt]'")

    def _check_webhook(self, webhook: WebhookDestination) -> None:
        if webhook.secret is None:
            raise ChannelError("a new webhook needs a secret, with which the receiver can check the signature")
        try:
            key_of(webhook.secret)
            url = checked_url(webhook.url)
            allowed(resolved(url), self._delivery.allow_networks)
        except (SecretError, UrlError) as error:
            raise ChannelError(str(error)) from error
        except OSError:
            pass  # the name may exist later; until then the queue says what is wrong


def _is_installed(package: str) -> bool:
    try:
        importlib.import_module(package)
    except ModuleNotFoundError:
        return False
    return True
