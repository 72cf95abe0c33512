"""The experiment that makes the app phyphox send a phone's motion to this service.

https://phyphox.org/wiki/index.php/Phyphox_file_format. Version 1.14 is that of phyphox 1.1.10: the first one whose
sensors take the attribute `rateStrategy`. Older apps ask the person to update them.
"""

from urllib.parse import quote, urlsplit
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from dropanchor_tag_client.sources.phones.readings import GYROSCOPE, MAGNETOMETER, TOTAL

MEDIA_TYPE = "application/phyphox"
VERSION = "1.14"
RATE_HZ = 100
INTERVAL_S = 0.2  # between two messages
KEPT = 10 * RATE_HZ  # readings that the app holds; it sends and clears them in every message
COLUMNS = {TOTAL: "accelerometer", GYROSCOPE: "gyroscope", MAGNETOMETER: "magnetometer"}
"""What the columns of each sensor begin with."""
AXES = ("t", "x", "y", "z")
PRESSURE_HZ = 10
PRESSURE = ("pressure_t", "pressure_x")
"""Columns of the barometer: its times, and hPa."""
USED = "used"
_TYPES = {TOTAL: "accelerometer", GYROSCOPE: "gyroscope", MAGNETOMETER: "magnetic_field"}


def link_of(url: str, tag: str, secret: str) -> str:
    """Return the link that the app opens to load the experiment. The app tries HTTPS first.

    url: address to which the app sends. secret: key of the tag, empty without one.
    """
    parts = urlsplit(url)
    return f"phyphox://{parts.netloc}{parts.path}?{_query(tag, secret)}"


def experiment(url: str, tag: str, secret: str) -> bytes:
    """Return the experiment file of a tag, XML. The arguments are those of `link_of`."""
    root = Element("phyphox", version=VERSION)
    SubElement(root, "title").text = f"Tag {tag}"
    SubElement(root, "category").text = "Dropanchor"
    SubElement(root, "description").text = (
        f"Sends the motion of this phone to {urlsplit(url).netloc} as that of the tag {tag}. The top edge of the phone "
        "is forward. Who has this file can send samples of the tag."
    )
    _add_containers(SubElement(root, "data-containers"))
    _add_sensors(SubElement(root, "input"))
    _add_view(SubElement(root, "views"), tag)
    _add_connection(SubElement(root, "network"), f"{url}?{_query(tag, secret)}")
    indent(root)
    content: bytes = tostring(root, "utf-8", xml_declaration=True)
    return content


def _query(tag: str, secret: str) -> str:
    token = f"&token={quote(secret, safe='')}" if secret else ""
    return f"tag={quote(tag, safe='')}{token}"


def _add_containers(parent: Element) -> None:
    for column in COLUMNS.values():
        for axis in AXES:
            SubElement(parent, "container", size=str(KEPT)).text = f"{column}_{axis}"
    for column in PRESSURE:
        SubElement(parent, "container", size=str(10 * PRESSURE_HZ)).text = column
    SubElement(parent, "container", size="1").text = USED


def _add_sensors(parent: Element) -> None:
    """Add the sensors. `request` gives every reading with its own time; the other strategies resample."""
    for name, column in COLUMNS.items():
        sensor = SubElement(parent, "sensor", type=_TYPES[name], rate=str(RATE_HZ), rateStrategy="request")
        if name == MAGNETOMETER:
            sensor.set("ignoreUnavailable", "true")
        for axis in AXES:
            SubElement(sensor, "output", component=axis).text = f"{column}_{axis}"
    barometer = SubElement(parent, "sensor", type="pressure", rate=str(PRESSURE_HZ), rateStrategy="request")
    barometer.set("ignoreUnavailable", "true")
    for column in PRESSURE:
        SubElement(barometer, "output", component=column[-1]).text = column


def _add_view(parent: Element, tag: str) -> None:
    view = SubElement(parent, "view", label="Tag")
    SubElement(view, "info", label=f"Press play: this phone is the tag {tag} until you press pause.")
    used = SubElement(view, "value", label="Samples in the last message", precision="0")
    SubElement(used, "input").text = USED


def _add_connection(parent: Element, address: str) -> None:
    connection = SubElement(
        parent,
        "connection",
        id="dropanchor",
        service="http/post",
        address=address,
        conversion="json",
        autoConnect="true",
        interval=str(INTERVAL_S),
    )
    SubElement(connection, "send", id="time", type="time")
    for column in (*(f"{sensor}_{axis}" for sensor in COLUMNS.values() for axis in AXES), *PRESSURE):
        SubElement(connection, "send", id=column, keep="false").text = column
    SubElement(connection, "receive", id="samples", append="false").text = USED
