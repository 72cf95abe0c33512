"""Tell Home Assistant of the tags and zones, as its documentation of MQTT discovery says.

https://www.home-assistant.io/integrations/mqtt/#mqtt-discovery, and there `device_tracker.mqtt`, `sensor.mqtt` and
`binary_sensor.mqtt`. The topic is <discovery>/<component>/<node>/<object>/config.
"""

from collections.abc import Iterator
from typing import Any
from urllib.parse import quote

from dropanchor_schemas.zones import Zone
from dropanchor_service.delivery.mqtt.topics import Topics

Config = tuple[str, dict[str, Any]]
"""A topic, and what stands in it."""

_TRACKED = "{{ 'online' if value_json.state == 'tracking' else 'offline' }}"
_NOT_LOST = "{{ 'offline' if value_json.state == 'lost' else 'online' }}"
_IN_ZONES = "{{ dict(value_json, in_zones=value_json.zones) | to_json }}"


def configs_of_tag(prefix: str, topics: Topics, tag: str, name: str, has_places: bool) -> Iterator[Config]:
    """Yield a tracker, which is available while the tag is tracked, and a sensor of its area.

    has_places: whether its positions have latitudes; without, Home Assistant compares the ids of zones with its own.
    """
    topic = topics.tag(tag)
    device = {"identifiers": [f"dropanchor/{topics.site}/{tag}"], "name": name, "manufacturer": "Dropanchor"}
    tracker = {"name": None, "json_attributes_topic": topic, "source_type": "gps"}
    if not has_places:
        tracker["json_attributes_template"] = _IN_ZONES
    area = {"name": "Area", "state_topic": topic, "json_attributes_topic": topic}
    area["value_template"] = "{{ value_json.area or 'outside' }}"
    for component, what, when in (("device_tracker", tracker, _TRACKED), ("sensor", area, _NOT_LOST)):
        yield _config(prefix, topics, component, ("tag", tag), what, device, {"topic": topic, "value_template": when})


def configs_of_zone(prefix: str, topics: Topics, zone: Zone) -> Iterator[Config]:
    """Yield a sensor of the number of tags in a zone, and whether there are any."""
    topic, name = topics.zone(zone.id), zone.name or zone.id
    device = {"identifiers": [f"dropanchor/{topics.site}"], "name": topics.site, "manufacturer": "Dropanchor"}
    count = {
        "name": name,
        "state_topic": topic,
        "value_template": "{{ value_json.count }}",
        "state_class": "measurement",
    }
    count |= {"unit_of_measurement": "tags", "json_attributes_topic": topic}
    any_tag = {"name": name, "state_topic": topic, "device_class": "occupancy"}
    any_tag["value_template"] = "{{ 'ON' if value_json.count else 'OFF' }}"
    for component, what in (("sensor", count), ("binary_sensor", any_tag)):
        yield _config(prefix, topics, component, ("zone", zone.id), what, device)


def _config(
    prefix: str,
    topics: Topics,
    component: str,
    whose: tuple[str, str],
    what: dict[str, Any],
    device: dict[str, Any],
    *available: dict[str, str],
) -> Config:
    node, thing = _level(topics.site), f"{whose[0]}-{_level(whose[1])}"
    shared = {
        "unique_id": f"dropanchor/{topics.site}/{'/'.join(whose)}/{component}",
        "availability": [{"topic": topics.status}, *available],
        "availability_mode": "all",
        "device": device,
        "origin": {"name": "Dropanchor"},
    }
    return f"{prefix}/{component}/{node}/{thing}/config", what | shared


def _level(identifier: str) -> str:
    """Return an id with the letters, digits, `-` and `_` alone that such a topic may have."""
    escaped = quote(identifier, safe="").replace("_", "%5F").replace(".", "%2E").replace("~", "%7E")
    return escaped.replace("%", "_")
