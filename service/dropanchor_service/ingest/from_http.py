"""Take messages that came over HTTP the way of those that came over Zenoh."""

from collections.abc import Callable

from dropanchor_schemas.keys import health_key, samples_key
from dropanchor_service.ingest.health import HealthIntake
from dropanchor_service.runtime.clock import UtcClock
from dropanchor_service.store import Sites

OnLive = Callable[[str, bytes, str, int], None]
"""Takes a live message: key, payload, encoding, UTC of its arrival in ns."""


class FromHttp:
    """on_live: takes samples, which may have to wait for cached ones. It changes when Zenoh is connected."""

    def __init__(self, sites: Sites, health: HealthIntake, clock: UtcClock, on_live: OnLive) -> None:
        self._sites = sites
        self._health = health
        self._clock = clock
        self.on_live = on_live

    def samples(self, site: str, tag: str, payload: bytes, encoding: str) -> None:
        """Take samples of a tag."""
        self._note(site, tag)
        self.on_live(samples_key(site, tag), payload, encoding, self._clock.now_ns())

    def health(self, site: str, tag: str, payload: bytes, encoding: str) -> None:
        """Take what a tag says about itself."""
        self._note(site, tag)
        self._health.put(health_key(site, tag), payload, encoding, self._clock.now_ns())

    def _note(self, site: str, tag: str) -> None:
        served = self._sites.find(site)
        assert served is not None
        served.tags.presence.note_http_message(tag)
