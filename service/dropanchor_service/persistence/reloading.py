"""Take changed settings over while the service runs: those of anchors and tags. The others are named."""

import logging
from collections.abc import Iterator, Mapping
from typing import Any

from dropanchor_service.persistence.site import settings_of
from dropanchor_service.settings.model import Settings
from dropanchor_service.store import Sites, SiteStore
from dropanchor_service.store.site_values import Configured

OF_A_SITE = {"site", "tags", "tag_defaults"}

_log = logging.getLogger(__name__)


def reload_settings(running: Settings, found: Settings, sites: Sites) -> None:
    """Let the sites follow the settings found, and log what changed and what needs a restart.

    running: the settings of the start. What was set over REST stays.
    """
    changed = [site.id for site in sites if site.id in found.site_ids and _follows(site.store, found, site.id)]
    _log.info(
        "reloaded: the settings of anchors and tags %s", f"of {', '.join(changed)}" if changed else "are as before"
    )
    if waiting := sorted(_restarting(running, found)):
        _log.warning("changed, but in force only after a restart: %s", ", ".join(waiting))


def _follows(store: SiteStore, found: Settings, site: str) -> bool:
    settings = settings_of(found, site)
    store.layers = settings.layers
    configured = Configured(settings.site, settings.listed_tags, settings.tag_defaults)
    if differs := configured != store.configured:
        store.configure(configured)
    return differs


def _restarting(running: Settings, found: Settings) -> Iterator[str]:
    """Yield the names of settings that differ and that only a start reads."""
    before, after = (s.model_dump(exclude=OF_A_SITE | {"sites"}) for s in (running, found))
    yield from _different(before, after)
    before, after = (
        {name: site.model_dump(exclude=OF_A_SITE) for name, site in s.sites.items()} for s in (running, found)
    )
    yield from (f"sites.{name}" for name in before.keys() | after.keys() if before.get(name) != after.get(name))
    if running.site_ids != found.site_ids and not running.sites and not found.sites:
        yield "site.id"


def _different(before: Mapping[str, Any], after: Mapping[str, Any], table: str = "") -> Iterator[str]:
    for name in before.keys() | after.keys():
        one, other = before.get(name), after.get(name)
        if isinstance(one, dict) and isinstance(other, dict) and not table:
            yield from _different(one, other, f"{name}.")
        elif one != other:
            yield table + name
