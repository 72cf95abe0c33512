"""Deliver events to a topic of an MQTT broker: one message for each."""

from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager

import orjson

from dropanchor_schemas.keys import chunk_from_id
from dropanchor_service.delivery.channel import Outcome, Portion
from dropanchor_service.delivery.mqtt.broker import AT_ONCE, Access, Broker, Brokers, Message
from dropanchor_service.delivery.sentences import SOURCE_PREFIX

CONTENT_TYPE = "application/cloudevents+json; charset=utf-8"


class MqttChannel:
    """Publishes events to a topic. topic: with `{site}`, `{tag}` and `{type}` for those of the event."""

    portion = Portion(AT_ONCE)

    def __init__(self, topic: str, broker: Broker) -> None:
        self._topic = topic
        self._broker = broker

    async def send(self, events: Sequence[bytes]) -> Sequence[Outcome]:
        return await self._broker.send([Message(topic_of(self._topic, event), event, CONTENT_TYPE) for event in events])


@asynccontextmanager
async def open_mqtt(topic: str, access: Access, brokers: Brokers) -> AsyncIterator[MqttChannel]:
    """Open the way to a topic. The connection is made with the first event."""
    async with brokers.of_this_loop(access) as broker:
        yield MqttChannel(topic, broker)


def topic_of(template: str, event: bytes) -> str:
    """Return the topic of an event. What is not allowed in one level of a topic is percent-escaped."""
    parsed = orjson.loads(event)
    values = {"site": parsed["source"].removeprefix(SOURCE_PREFIX), "tag": parsed["subject"], "type": parsed["type"]}
    return template.format(**{name: chunk_from_id(value) for name, value in values.items()})
