"""Publish the measurements in messages of a broker. What is left out is counted, and logged at most once per second."""

import logging
import time
from collections import Counter
from collections.abc import Iterable, Mapping
from typing import Any

from dropanchor_schemas.keys import InvalidKeyError
from dropanchor_tag_client.client import TagClient
from dropanchor_tag_client.credentials import OtherTagError
from dropanchor_tag_client.sources.bridge.measurement import Drop, Dropped, Format, Found, Measurement, Received
from dropanchor_tag_client.sources.bridge.topics import matches
from dropanchor_tag_client.sources.publish import BadLineError, publisher_of

MAX_TAGS = 256
_LOG_INTERVAL_S = 1.0

_log = logging.getLogger(__name__)


class Bridge:
    """Send each measurement to the client of its tag.

    dropped: what was left out so far, by reason. samples: number of samples that were published.
    """

    def __init__(
        self, formats: Iterable[Format], options: Mapping[str, Any], prefix: str, names: Mapping[str, str]
    ) -> None:
        """options: of the clients. prefix: of the ids of the tags. names: the site's names of anchors, by their ids."""
        self.dropped: Counter[Drop] = Counter()
        self.samples = 0
        self._formats = tuple(formats)
        self._options = options
        self._prefix = prefix
        self._names = names
        self._clients: dict[str, TagClient] = {}
        self._logged: Counter[Drop] = Counter()
        self._last_detail: dict[Drop, str] = {}
        self._next_s = 0.0

    @property
    def clients(self) -> Iterable[TagClient]:
        """Return a view of the clients, which grows with them."""
        return self._clients.values()

    def take(self, message: Received) -> None:
        """Publish what a message holds."""
        for one in self._formats:
            if any(matches(topic, message.topic) for topic in one.topics):
                self._take_all(one.parse(message))

    def flush(self) -> None:
        for one in self._formats:
            self._take_all(one.overdue(time.time_ns()))
        for client in self._clients.values():
            client.flush()

    def count_lost(self, total: int) -> None:
        """Count the messages that came faster than they could be used. total: since the start."""
        if total > self.dropped[Drop.BACKLOG]:
            self.dropped[Drop.BACKLOG] = total
            self._last_detail[Drop.BACKLOG] = "messages came faster than they can be used"

    def log_dropped(self) -> None:
        """Log what was left out since the last time, at most once per second."""
        news = self.dropped - self._logged
        if not news or time.monotonic() < self._next_s:
            return
        self._next_s = time.monotonic() + _LOG_INTERVAL_S
        self._logged = Counter(self.dropped)
        _log.warning(
            "left out: %s",
            "; ".join(
                f"{reason.value} {count} ({self._last_detail[reason]})" for reason, count in sorted(news.items())
            ),
        )

    def summary(self) -> str:
        counts = ", ".join(f"{reason.value} {count}" for reason, count in sorted(self.dropped.items()))
        left_out = f"; left out: {counts}" if counts else ""
        return f"{self.samples} samples of {len(self._clients)} tags published{left_out}"

    def close(self) -> None:
        for client in self._clients.values():
            client.close()

    def _take_all(self, parts: Iterable[Found]) -> None:
        for found in parts:
            self._drop(found) if isinstance(found, Dropped) else self._publish(found)

    def _publish(self, found: Measurement) -> None:
        fields = dict(found.fields)
        if "anchor" in fields:
            fields["anchor"] = self._names.get(str(fields["anchor"]), fields["anchor"])
        try:
            publish = publisher_of(found.kind, fields)
            client = self._client(self._prefix + found.tag)
        except BadLineError as error:
            return self._drop(Dropped(Drop.NOT_UNDERSTOOD, f"tag {found.tag}: {error}"))
        except InvalidKeyError as error:
            return self._drop(Dropped(Drop.TAG_INVALID, f"{found.tag!r}: {error}"))
        except OtherTagError as error:
            return self._drop(Dropped(Drop.OTHER_TAG, f"tag {found.tag}: {error}"))
        if client is None:
            return self._drop(Dropped(Drop.TOO_MANY_TAGS, f"tag {found.tag} is number {MAX_TAGS + 1}"))
        refused = Counter(client.refused)
        try:
            publish(client)
        except ValueError as error:  # such as an anchor id that is too long
            return self._drop(Dropped(Drop.NOT_UNDERSTOOD, f"tag {found.tag}: {error}"))
        for reason in client.refused - refused:
            return self._drop(Dropped(Drop.REFUSED, f"tag {found.tag}: {reason.value}"))
        self.samples += found.kind != "health"
        return None

    def _client(self, tag: str) -> TagClient | None:
        if tag not in self._clients:
            if len(self._clients) >= MAX_TAGS:
                return None
            client = TagClient(tag, **self._options)
            client.open()
            self._clients[tag] = client
            _log.info("tag %s is heard", tag)
        return self._clients[tag]

    def _drop(self, dropped: Dropped) -> None:
        self.dropped[dropped.reason] += 1
        self._last_detail[dropped.reason] = dropped.detail
