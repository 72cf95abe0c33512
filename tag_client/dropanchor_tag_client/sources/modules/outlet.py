"""Publish the reports of a module: as one tag, or as every tag that the module names."""

import math
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple, Protocol

from dropanchor_schemas.wire import anchor_number
from dropanchor_tag_client.client import TagClient
from dropanchor_tag_client.credentials import OtherTagError
from dropanchor_tag_client.sources.axes import Mounting, UpAxis, direction
from dropanchor_tag_client.sources.modules.report import Imu, Range, Report
from dropanchor_tag_client.sources.modules.status_log import StatusLog

MAX_TAGS = 256


class Outlet(Protocol):
    def publish(self, report: Report, t_ns: int) -> None: ...

    def flush(self) -> None: ...


class Azimuth(NamedTuple):
    """How to take the azimuths of a module. is_mirrored: left is right, as when it hangs upside down."""

    std_rad: float = math.radians(10.0)
    is_mirrored: bool = False


class Samples:
    """Publish ranges and IMU samples under the names and in the axes of the site."""

    def __init__(self, names: Mapping[str, str], mounted: Mounting, log: StatusLog, azimuth: Azimuth) -> None:
        self._names = names
        self._mounted = mounted
        self._azimuth = azimuth
        self._log = log
        self._anchors: set[str] = set()
        self._up_axis: UpAxis | None = UpAxis()

    def range(self, client: TagClient, anchor: int | str, one: Range, t_ns: int) -> None:
        name = self._names.get(str(anchor), anchor)
        client.publish_range(name, one.range_m, t_ns=t_ns, std_m=one.std_m)
        self._log.ranges += 1
        if str(name) not in self._anchors and len(self._anchors) < MAX_TAGS:
            self._anchors.add(str(name))
            self._log.add(f'tag "{client.tag}": anchor "{name}"{_number(str(name))} at {one.range_m:.2f} m')

    def azimuth(self, client: TagClient, anchor: str, one: Range, t_ns: int) -> None:
        """Publish the azimuth that the anchor has measured, if it has."""
        if not math.isnan(one.azimuth_rad):
            bearing_rad = -one.azimuth_rad if self._azimuth.is_mirrored else one.azimuth_rad
            name = self._names.get(anchor, anchor)
            client.publish_bearing(name, bearing_rad, t_ns=t_ns, std_rad=self._azimuth.std_rad)

    def imu(self, client: TagClient, imu: Imu, t_ns: int) -> None:
        mag = None if imu.mag is None else self._mounted.to_body(imu.mag)
        client.publish_imu(self._mounted.to_body(imu.acc), self._mounted.to_body(imu.gyro), mag, t_ns=t_ns)
        self._log.imu += 1
        if self._up_axis is not None and (up := self._up_axis.add(imu.acc)) is not None:
            self._up_axis = None
            if self._mounted.up != direction(up):
                self._log.add(f"gravity says that axis {up} of the module points up: start again with --up={up}")


def _number(name: str) -> str:
    """Return how a service whose site does not have the anchor calls it, if that differs from its name."""
    number = str(anchor_number(name))
    return "" if number == name else f" (number {number})"


class OneTag:
    """Publish everything as one tag. If the module reports several tags, only the first one counts."""

    def __init__(self, client: TagClient, names: Mapping[str, str], mounted: Mounting, log: StatusLog) -> None:
        self._client = client
        self._samples = Samples(names, mounted, log, Azimuth())
        self._log = log
        self._only: str | None = None

    def publish(self, report: Report, t_ns: int) -> None:
        for one in report.ranges:
            if self._is_ours(one.tag):
                self._note_azimuth(one)
                self._samples.range(self._client, one.anchor, one, t_ns)
        if report.imu is not None and self._is_ours(report.imu.tag):
            self._samples.imu(self._client, report.imu, t_ns)

    def flush(self) -> None:
        """Do nothing: the client itself sends in time."""

    def _note_azimuth(self, one: Range) -> None:
        if not math.isnan(one.azimuth_rad):
            self._log.add("the module measures azimuths, which are of use where it is an anchor: --as-anchor NAME")

    def _is_ours(self, tag: str | None) -> bool:
        if self._only is None:
            self._only = tag
        if tag == self._only:
            return True
        self._log.add(f"the module reports tag {tag} as well as {self._only}, which is left out; see --tag-from-id")
        return False


class ManyTags:
    """Publish as each tag that the module names, with a client per tag and one session."""

    def __init__(
        self,
        prefix: str,
        options: dict[str, Any],
        as_anchor: str | None,
        names: Mapping[str, str],
        mounted: Mounting,
        log: StatusLog,
        azimuth: Azimuth,
    ) -> None:
        """options: of the clients. as_anchor: the anchor that the module itself is; its ranges are then to tags."""
        self._prefix = prefix
        self._options = options
        self._as_anchor = as_anchor
        self._samples = Samples(names, mounted, log, azimuth)
        self._log = log
        self._clients: dict[str, TagClient] = {}

    def publish(self, report: Report, t_ns: int) -> None:
        for one in report.ranges:
            tag, anchor = self._tag_and_anchor(one)
            if (client := self._client(tag)) is not None:
                self._samples.range(client, anchor, one, t_ns)
                if self._as_anchor is not None:
                    self._samples.azimuth(client, self._as_anchor, one, t_ns)
        if report.imu is not None and self._as_anchor is None and (client := self._client(report.imu.tag)) is not None:
            self._samples.imu(client, report.imu, t_ns)

    def flush(self) -> None:
        for client in self._clients.values():
            client.flush()

    @property
    def clients(self) -> Iterable[TagClient]:
        """Return a view of the clients, which grows with them."""
        return self._clients.values()

    def close(self) -> None:
        for client in self._clients.values():
            client.close()

    def _tag_and_anchor(self, one: Range) -> tuple[str | None, int | str]:
        return (one.tag, one.anchor) if self._as_anchor is None else (str(one.anchor), self._as_anchor)

    def _client(self, tag: str | None) -> TagClient | None:
        if tag is None:
            self._log.add("the module does not say whose ranges these are; --as-anchor NAME: those of what it names")
            return None
        if tag not in self._clients:
            if len(self._clients) >= MAX_TAGS:
                self._log.add(f"the module has named {MAX_TAGS} tags; tag {tag} is left out")
                return None
            try:
                client = TagClient(self._prefix + tag, **self._options)
            except OtherTagError as error:
                self._log.add(f"tag {tag} is left out: {error}")
                return None
            client.open()
            self._clients[tag] = client
        return self._clients[tag]
