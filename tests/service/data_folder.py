"""Everything that a service has in a data folder, and what it may suffer there."""

import os
import resource
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from dropanchor_schemas.destinations import WebhookDestination
from dropanchor_schemas.plans import Plan
from dropanchor_schemas.shares import ShareRequest
from dropanchor_schemas.site import Anchor, TagSettings
from dropanchor_schemas.zones import BatteryLowRule
from dropanchor_service.api.routes.plan_examples import PLAN
from dropanchor_service.checkpoints.files import CheckpointFolder
from dropanchor_service.checkpoints.format import Snapshot, UnreadableLayoutError
from dropanchor_service.checkpoints.layouts import why_unreadable
from dropanchor_service.delivery.receiver_networks import AllowedNetwork
from dropanchor_service.estimation.columns import POSE
from dropanchor_service.events.drafts import destination_test
from dropanchor_service.history.errors import HistoryError
from dropanchor_service.history.tracks import Tracks
from dropanchor_service.metrics.registry import Metrics
from dropanchor_service.persistence.site import open_sites
from dropanchor_service.persistence.site_files import own_data_folder, put_site_files_in_place
from dropanchor_service.persistence.site_folders import SiteFolders
from dropanchor_service.persistence.zone_events import ZoneEvents
from dropanchor_service.plans.reading.messages import Description, ReadPlan
from dropanchor_service.runtime.recovery import Recovery
from dropanchor_service.security.credentials import authenticator_of, credentials_of
from dropanchor_service.security.identity import UnauthenticatedError
from dropanchor_service.security.share_links import ShareLinks, share_links_of
from dropanchor_service.settings.model import Settings
from dropanchor_service.settings.sources import SettingsError, load_settings
from dropanchor_service.store import LatestPoses
from dropanchor_service.store.omlox_models import Fence, LocationProvider, Trackable
from support.events import circle
from support.plan_files import image_file

T_NS = 1_800_000_000_000_000_000
NOBODY = 65534
CHECKPOINT = "checkpoints/checkpoint-000000000002"
WITH_COPY = [
    *("site.json", "zones.json", "event_rules.json", "destinations.json", "receiver_networks.json", "plans.json"),
    *("omlox_trackables.json", "omlox_tag_trackables.json", "omlox_providers.json", "omlox_fences.json"),
]
BEGIN_EMPTY = ["history.sqlite", "events.sqlite", "share_links.json", "share_key"]
OTHERS = [CHECKPOINT, "plans/image"]
FILES = [*WITH_COPY, *BEGIN_EMPTY, *OTHERS]
NOT_READ = {"owner.lock", ".lock", "site", "written_by", "checkpoints/checkpoint-000000000001"}

DATABASES = ["history.sqlite", "events.sqlite"]  # SQLite needs to write beside them
IN_SECURITY = ["issued.json", "keys/api_keys.json", "ca.key"]


class Parts:
    """Everything that a service opens in the folder."""

    def __init__(self, folder: Path) -> None:
        security = {"folder": str(folder / "security")}
        settings = load_settings(options={"data_dir": str(folder / "data"), "security": security}, environment={})
        self.folder = folder / "data"
        self.recovery = Recovery(self.folder)
        self.lock = ExitStack()
        self.lock.enter_context(own_data_folder(settings, shared=False, note=self.recovery.note))
        try:
            self._open(settings)
        except SettingsError:
            self.close()
            raise

    def _open(self, settings: Settings) -> None:
        put_site_files_in_place(settings)
        credentials_of(settings)
        sites, metrics = open_sites(settings, self.recovery), Metrics()
        sites[0].tags.register("cart")
        self.site, now_ns = sites[0].store, lambda: T_NS
        links = share_links_of(authenticator_of(settings, self.recovery))
        assert links is not None
        self.links = links
        self.persistence = SiteFolders(settings, sites, now_ns, metrics, self.recovery).all[0]
        self.zone_events = ZoneEvents(settings, sites, LatestPoses(), now_ns, metrics, self.recovery)
        self.events = self.zone_events.parts[0]
        self.omlox, self.plans = self.persistence.omlox, self.persistence.plans
        assert self.persistence.tracks is not None
        self.tracks = self.persistence.tracks
        folder = self.folder / "checkpoints"
        self.checkpoints = CheckpointFolder(folder, "layout", as_present, self.recovery)

    def close(self) -> None:
        if hasattr(self, "zone_events"):
            self.zone_events.__exit__()
        if self.lock is not None:
            self.lock.close()

    def fill(self) -> str:
        """Write something to every file. Return the token of a share link."""
        self.site.set_anchor(Anchor(id="7"))
        self.site.set_tag("cart", TagSettings(name="Cart"))
        self.events.items.zones.put("dock", circle())
        self.events.items.rules.put("battery", BatteryLowRule(id="battery", type="battery_low"))
        hook = WebhookDestination(id="mes", type="webhook", url="https://mes.example/", secret=f"whsec_{'A' * 40}")
        self.events.destinations.put("mes", hook)
        network = AllowedNetwork(network="192.168.1.0/24")
        self.events.channels.networks.items.put(network.network, network)
        self.events.store.commit([destination_test("mes")], {})
        image = self.plans.add_image(ReadPlan(Description(), image_file()))
        self.plans.put("ground-floor", Plan.model_validate(PLAN | {"image": image.model_dump()}))
        self.omlox.trackables.put("t", Trackable(type="omlox"))
        self.omlox.tag_trackables.put("t", Trackable(type="omlox"))
        self.omlox.providers.put("t", LocationProvider(id="cart", type="uwb"))
        self.omlox.fences.put("t", Fence.model_validate({"region": {"type": "Point", "coordinates": [0.0, 0.0]}}))
        with self.tracks:
            self.tracks.keep(poses_of_cart())
        for value in (1, 2):  # each by another process, so both are whole
            CheckpointFolder(self.folder / "checkpoints", "layout", as_present).write(Snapshot({}, {"value": value}))
        return self.links.add("default", ShareRequest(name="crew", valid_s=1_000_000))[1]

    def held(self, token: str) -> dict[str, bool]:
        """Return what there is of each file."""
        newest, _ = self.checkpoints.newest()
        (plan,) = self.plans.all.values() or [None]
        return {
            "site.json": self.site.tag_settings("cart").name == "Cart" and self.site.anchor("7") is not None,
            "zones.json": "dock" in self.events.items.zones.all,
            "event_rules.json": "battery" in self.events.items.rules.all,
            "destinations.json": "mes" in self.events.destinations.all,
            "receiver_networks.json": "192.168.1.0/24" in self.events.channels.networks.items.all,
            "plans.json": plan is not None,
            "plans/image": plan is None or self.plans.content(plan.image) is not None,
            "omlox_trackables.json": "t" in self.omlox.trackables.all,
            "omlox_tag_trackables.json": "t" in self.omlox.tag_trackables.all,
            "omlox_providers.json": "t" in self.omlox.providers.all,
            "omlox_fences.json": "t" in self.omlox.fences.all,
            "history.sqlite": has_cart(self.tracks),
            "events.sqlite": self.events.store.newest == 1,
            "share_links.json": bool(self.links.of_site("default")),
            "share_key": is_let_in(self.links, token) or not self.links.of_site("default"),
            CHECKPOINT: newest is not None and newest.document["value"] == 2,
        }


def as_present(layout: str, found: Snapshot) -> Snapshot:
    if (why := why_unreadable(layout, "layout")) is not None:
        raise UnreadableLayoutError(f"its layout is {why}")
    return found


def poses_of_cart() -> Any:
    poses = np.zeros(200, POSE)
    poses["t_ns"], poses["anchor"] = T_NS + np.arange(len(poses)) * 1_000_000_000, -1
    return poses


def is_let_in(links: ShareLinks, token: str) -> bool:
    try:
        links.identify(token)
    except UnauthenticatedError:
        return False
    return True


def has_cart(tracks: Tracks) -> bool:
    try:
        return tracks.reader.has_tag("cart")
    except HistoryError:  # the file is good, but SQLite cannot use it in a folder that is read-only
        return False


@contextmanager
def opened(folder: Path) -> Iterator[Parts]:
    parts = Parts(folder)
    try:
        yield parts
    finally:
        parts.close()


def file_in(folder: Path, name: str) -> Path:
    if name in IN_SECURITY:
        return folder / "security" / name
    if name == "plans/image":
        return next((folder / "data" / "plans").glob("*.png"))
    return folder / "data" / name


@contextmanager
def without_rights(folder: Path) -> Iterator[None]:
    """Be a user that permissions count for, and that owns the folder."""
    if os.geteuid() != 0:
        yield
        return
    for path in (folder.parent, folder, *folder.rglob("*")):
        os.chown(path, NOBODY, NOBODY)
    os.seteuid(NOBODY)
    try:
        yield
    finally:
        os.seteuid(0)


@contextmanager
def full_disk() -> Iterator[None]:
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
