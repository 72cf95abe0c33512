"""Open the way to a destination of any type, and refuse those to which nothing could be delivered."""

import importlib
import ssl
from collections.abc import Mapping
from contextlib import AbstractAsyncContextManager
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from dropanchor_schemas.destinations import (
    Destination,
    EmailDestination,
    MqttDestination,
    MqttPosesDestination,
    WebhookDestination,
)
from dropanchor_schemas.sentences import said_by, say, with_stop
from dropanchor_service.delivery.addresses import RefusedAddressError, UrlError, allowed, checked_url, resolved
from dropanchor_service.delivery.channel import Channel, ChannelError, tls_context
from dropanchor_service.delivery.receiver_networks import ReceiverNetworks
from dropanchor_service.delivery.sentences import NameOf, ZoneOf
from dropanchor_service.delivery.signature import SecretError, key_of
from dropanchor_service.settings.events import DeliverySettings, EmailSettings, MqttSettings

if TYPE_CHECKING:
    from dropanchor_service.delivery.live_site import LiveSite
    from dropanchor_service.delivery.mqtt.broker import Access, Brokers
    from dropanchor_service.delivery.mqtt.poses import PosesFeed


_MQTT = ("mqtt", "mqtt_poses")


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
        from dropanchor_service.delivery.mqtt.broker import Brokers  # an extra

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
        networks: ReceiverNetworks | None = None,
        zone_of: ZoneOf = lambda: None,
    ) -> None:
        """name_of: by default, the id of the tag. shared: by all sites. networks: by default, those of the settings.

        Raises OSError; see `SharedWays`.
        """
        self.networks = networks or ReceiverNetworks(delivery.allow_networks)
        self._delivery = delivery
        self._email = email
        self._mqtt = mqtt
        self._name_of = name_of
        self._zone_of = zone_of
        self._shared = shared or SharedWays(delivery.authorities)

    def open(self, destination: Destination) -> AbstractAsyncContextManager[Channel]:
        """Return the way to a destination as a context. It must have passed `check_settings`."""
        timeout_s = self._delivery.timeout_s
        match destination:
            case WebhookDestination():
                from dropanchor_service.delivery.webhook import open_webhook  # these libraries take memory

                return open_webhook(destination, self._shared.webhook, timeout_s, self.networks)
            case EmailDestination():
                from dropanchor_service.delivery.mail import open_mail

                page, tls = self._delivery.page, self._shared.email
                of_site = self.networks, page, self._name_of, self._zone_of
                return open_mail(destination, self._email, tls, timeout_s, *of_site)
            case MqttDestination() | MqttPosesDestination():
                from dropanchor_service.delivery.mqtt.events import open_mqtt  # an extra

                return open_mqtt(_topic_of_events(destination), self._broker(), self._shared.brokers)

    def open_poses(
        self, destination: MqttPosesDestination, live: "LiveSite"
    ) -> AbstractAsyncContextManager["PosesFeed"]:
        """Return what publishes the poses of a site as a context. It must have passed `check_settings`."""
        from dropanchor_service.delivery.mqtt.poses import open_poses  # an extra

        return open_poses(destination, live, self._broker(), self._shared.brokers)

    def _broker(self) -> "Access":
        from dropanchor_service.delivery.mqtt.broker import Access  # an extra

        delivery = self._delivery
        return Access(self._mqtt, self._shared.mqtt, delivery.timeout_s, delivery.allow_networks)

    def check(self, destination: Destination) -> None:
        """Raise ChannelError when nothing could be delivered. It may resolve a name, and blocks then."""
        self.check_settings(destination)
        if isinstance(destination, WebhookDestination):
            self._check_webhook(destination)

    def check_settings(self, destination: Destination) -> None:
        """Raise ChannelError when the settings lack what the type of the destination needs."""
        self._check_type(destination.type)

    def unavailable(self) -> Mapping[str, str]:
        """Return the types for which the settings lack something, each with what to do."""
        found = {}
        for kind in ("email", *_MQTT):
            try:
                self._check_type(kind)
            except ChannelError as error:
                found[kind] = with_stop(said_by(error))
        return found

    def _check_type(self, kind: str) -> None:
        if kind == "email" and self._email.server is None:
            raise ChannelError(
                say("no_mail_server", "an e-mail needs a mail server: set `server` in `[email]` of the settings")
            )
        if kind in _MQTT and self._mqtt.server is None:
            raise ChannelError(say("no_broker", "MQTT needs a broker: set `server` in `[mqtt]` of the settings"))
        if kind in _MQTT and not _is_installed("paho.mqtt"):
            raise ChannelError(say("no_mqtt", "MQTT needs the extra `mqtt`: pip install 'dropanchor-service[mqtt]'"))

    def _check_webhook(self, webhook: WebhookDestination) -> None:
        if webhook.secret is None:
            raise ChannelError(
                say("no_secret", "a new webhook needs a secret, with which the receiver can check the signature")
            )
        try:
            key_of(webhook.secret)
            url = checked_url(webhook.url)
            allowed(resolved(url), self.networks)
        except RefusedAddressError as error:
            raise ChannelError(said_by(error), None if error.network is None else str(error.network)) from error
        except (SecretError, UrlError) as error:
            raise ChannelError(said_by(error)) from error
        except OSError:
            pass  # the name may exist later; until then the queue says what is wrong


def _topic_of_events(destination: MqttDestination | MqttPosesDestination) -> str:
    """Return the topic of events. A destination of poses gets none but those that test it."""
    return destination.topic if isinstance(destination, MqttDestination) else f"{destination.prefix}/{{site}}/test"


def _is_installed(package: str) -> bool:
    try:
        importlib.import_module(package)
    except ModuleNotFoundError:
        return False
    return True
