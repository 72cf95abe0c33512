"""Messages of any other form, by rules from a TOML file: from topic to tag, from JSON path to field.

[[rule]]
topic = "plant/+/uwb"            # a filter; {1} below is what the first + stands for
tag = "cart-{1}"                 # or "{device.id}": from the payload
kind = "range"                   # range, imu, heading, bearing or pressure
each = "anchors"                 # optional: a list or an object in the payload, or several lists of the same length;
                                 # "[]": the payload is the list; "tags[].ranges": the list in each element of another.
                                 # Paths begin at each of its elements; the time and the tag may stand beside it
clock = "boot"                   # optional: t_ns counts from the start of the device
time_unit = "ms"                 # of t_ns: ns, us, ms or s; without t_ns the time of arrival is used
[rule.fields]
anchor = "id"                    # a path: names and list indices with dots; "{2}" is what the second + stands for,
                                 # "{topic[3]}" a level of the topic, "{key}" the name of an element, "{value}" the
                                 # element itself, and "=yard" is the text yard itself
range_m = "distance"
t_ns = "time"
[rule.unit]
range_m = "cm"
"""

from collections.abc import Iterator
from pathlib import Path

from dropanchor_tag_client.sources.bridge.measurement import (
    Dropped,
    Format,
    Found,
    Received,
    json_of,
    refused_retained,
)
from dropanchor_tag_client.sources.bridge.rules import rules_of
from dropanchor_tag_client.sources.bridge.topics import matches


class Template(Format):
    """The rules of one file."""

    def __init__(self, path: Path) -> None:
        """Raises TemplateError."""
        self._rules = rules_of(path)
        self.topics = tuple(dict.fromkeys(rule.topic for rule in self._rules))

    def parse(self, message: Received) -> Iterator[Found]:
        rules = [rule for rule in self._rules if matches(rule.topic, message.topic)]
        if message.retained and not any(rule.retained for rule in rules):
            yield refused_retained(message, ". retained = true in the rule takes it all the same")
            return
        value = json_of(message.payload)
        if isinstance(value, Dropped):
            yield value._replace(detail=f"{message.topic}: {value.detail}")
            return
        for rule in rules:
            if message.retained and not rule.retained:
                continue
            yield from rule.parse(message.topic, value, message.t_ns)
