"""Whatever happens to a file of the data folder, the service starts, says what is damaged, and serves the rest.

Each file that a service writes gets each fault. `test_this_page_knows_every_file` finds those that are missing here.
"""

import os
import resource
import shutil
import sqlite3
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import orjson
import pytest

from dropanchor_schemas import Anchor
from dropanchor_schemas.destinations import WebhookDestination
from dropanchor_schemas.plans import Plan
from dropanchor_schemas.shares import ShareRequest
from dropanchor_schemas.site import TagSettings
from dropanchor_schemas.zones import BatteryLowRule
from dropanchor_service.api.omlox.models import Fence, LocationProvider, Trackable
from dropanchor_service.api.routes.plan_examples import PLAN
from dropanchor_service.checkpoints.files import CheckpointFolder
from dropanchor_service.checkpoints.format import Snapshot, UnreadableLayoutError, decoded
from dropanchor_service.estimation.columns import POSE
from dropanchor_service.events.drafts import destination_test
from dropanchor_service.history.errors import HistoryError
from dropanchor_service.history.tracks import Tracks
from dropanchor_service.metrics.registry import Metrics
from dropanchor_service.persistence import open_sites
from dropanchor_service.plans.reading.messages import Description, ReadPlan
from dropanchor_service.runtime.recovery import COPY, MARK, Recovery, copy_of
from dropanchor_service.security.api_keys import ApiKeys
from dropanchor_service.security.credentials import authenticator_of, credentials_of
from dropanchor_service.security.folder import SecurityError, SecurityFolder
from dropanchor_service.security.identity import Scope, UnauthenticatedError
from dropanchor_service.security.issued import Table
from dropanchor_service.security.share_links import ShareLinks, share_links_of
from dropanchor_service.settings.model import Settings
from dropanchor_service.settings.sources import SettingsError, load_settings
from dropanchor_service.site_files import own_data_folder, put_site_files_in_place
from dropanchor_service.site_folders import SiteFolders
from dropanchor_service.store import LatestPoses
from dropanchor_service.zone_events import ZoneEvents
from support.events import circle
from support.plan_files import image_file

T_NS = 1_800_000_000_000_000_000
NOBODY = 65534
CHECKPOINT = "checkpoints/checkpoint-000000000002"
WITH_COPY = [
    *("site.json", "zones.json", "event_rules.json", "destinations.json", "plans.json"),
    *("omlox_trackables.json", "omlox_tag_trackables.json", "omlox_providers.json", "omlox_fences.json"),
]
BEGIN_EMPTY = ["history.sqlite", "events.sqlite", "share_links.json", "share_key"]
OTHERS = [CHECKPOINT, "plans/image"]
FILES = [*WITH_COPY, *BEGIN_EMPTY, *OTHERS]
NOT_READ = {"owner.lock", ".lock", "site", "checkpoints/checkpoint-000000000001"}

DATABASES = ["history.sqlite", "events.sqlite"]  # SQLite needs to write beside them
IN_SECURITY = ["issued.json", "api_keys.json", "ca.key"]


class Parts:
    """Everything that a service opens in the folder."""

    def __init__(self, folder: Path) -> None:
        security = {"folder": str(folder / "security")}
        settings = load_settings(options={"data_dir": str(folder / "data"), "security": security}, environment={})
        self.folder = folder / "data"
        self.recovery = Recovery(self.folder)
        self.lock = own_data_folder(settings, shared=False)
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
        links = share_links_of(authenticator_of(settings, "default", self.recovery))
        assert links is not None
        self.links = links
        self.persistence = SiteFolders(settings, sites, now_ns, metrics, self.recovery).all[0]
        self.zone_events = ZoneEvents(settings, sites, LatestPoses(), now_ns, metrics, self.recovery)
        self.events = self.zone_events.parts[0]
        self.omlox, self.plans = self.persistence.omlox, self.persistence.plans
        assert self.persistence.tracks is not None
        self.tracks = self.persistence.tracks
        folder = self.folder / "checkpoints"
        self.checkpoints = CheckpointFolder(folder, "layout", decode, self.recovery)

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
        self.events.store.commit([destination_test("mes")], {})
        image = self.plans.add_image(ReadPlan(Description(), image_file()))
        self.plans.put("ground-floor", Plan.model_validate(PLAN | {"image": image.model_dump()}))
        self.omlox.trackables.put("t", Trackable(type="omlox"))
        self.omlox.tag_trackables.put("t", Trackable(type="omlox"))
        self.omlox.providers.put("t", LocationProvider(id="cart", type="uwb"))
        self.omlox.fences.put("t", Fence(region={"type": "Point", "coordinates": [0.0, 0.0]}))
        with self.tracks:
            self.tracks.keep(poses_of_cart())
        for value in (1, 2):
            self.checkpoints.write(Snapshot({}, {"value": value}))
        return self.links.add("default", ShareRequest(name="crew", valid_s=1e6))[1]

    def held(self, token: str) -> dict[str, bool]:
        """Return what there is of each file."""
        newest, _ = self.checkpoints.newest()
        (plan,) = self.plans.all.values() or [None]
        return {
            "site.json": self.site.tag_settings("cart").name == "Cart" and self.site.anchor("7") is not None,
            "zones.json": "dock" in self.events.items.zones.all,
            "event_rules.json": "battery" in self.events.items.rules.all,
            "destinations.json": "mes" in self.events.destinations.all,
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


def decode(whole: bytes) -> Snapshot:
    layout, found = decoded(whole)
    if layout != "layout":
        raise UnreadableLayoutError(f"its layout is {layout}")
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
        return tracks.has_tag("cart")
    except HistoryError:  # the file is good, but SQLite cannot use it in a folder that is read-only
        return False


@contextmanager
def opened(folder: Path) -> Iterator[Parts]:
    parts = Parts(folder)
    try:
        yield parts
    finally:
        parts.close()


@pytest.fixture(scope="module")
def filled(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """Return a folder in which a service has written every file, and the token of a share link."""
    folder = tmp_path_factory.mktemp("filled")
    SecurityFolder.make(folder / "security", Table(site="default", hosts=("localhost",), listen=("tls/[::]:7447",)), 9)
    ApiKeys(folder / "security").add("yard-manager", Scope.ADMIN)
    with opened(folder) as parts:
        return folder, parts.fill()


@pytest.fixture
def folder(filled: tuple[Path, str]) -> Iterator[Path]:
    """A copy of the folder in a place that a user without rights can reach."""
    with TemporaryDirectory() as made:
        target = Path(made) / "copy"
        shutil.copytree(filled[0], target)
        yield target


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


def truncate(path: Path) -> None:
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def flip(path: Path) -> None:
    whole = bytearray(path.read_bytes())
    for place in range(8) if path.suffix == ".sqlite" else [len(whole) // 2]:
        whole[place] ^= 0x80
    path.write_bytes(whole)


def empty(path: Path) -> None:
    path.write_bytes(b"")


def make_it_of_another_type(path: Path) -> None:
    path.write_bytes(b"[1]\n")


def lock_up(path: Path) -> None:
    path.chmod(0)


CHANGES = [truncate, flip, empty, make_it_of_another_type]


def check(folder: Path, name: str, token: str, unusable: Sequence[str] = ()) -> None:
    """Check that a service starts, holds all that is good, and names what is not.

    unusable: what cannot be used, although it is good.
    """
    with opened(folder) as parts:
        held = parts.held(token)
        lost = {*unusable, *(() if name in WITH_COPY else (name,))}
        lost -= {"plans/image"} if unusable and held["plans/image"] else set()  # it is served as it is
        if name == "share_links.json":
            lost |= {"share_key"} if held["share_key"] is False else set()
        assert {each for each, is_there in held.items() if not is_there} == lost
        assert parts.tracks.writer.flush() or unusable
        problems = "; ".join([*parts.recovery.problems(), *parts.persistence.problems()])
        for each in (name, *unusable):
            assert in_words(each) in problems
        if name.startswith("share_"):
            assert not is_let_in(parts.links, token)


def in_words(name: str) -> str:
    return {"plans/image": ".png", "history.sqlite": "history"}.get(name, name)


@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize("name", FILES)
def test_a_damaged_file_is_set_aside_and_the_rest_is_served(
    folder: Path, filled: tuple[Path, str], name: str, change: Callable[[Path], None]
) -> None:
    if (name, change) == ("share_key", flip):
        pytest.skip("any 32 bytes are a key: see test_another_key_ends_all_links")
    path = file_in(folder, name)
    change(path)
    whole = path.read_bytes()
    check(folder, name, filled[1])
    (aside,) = path.parent.glob(f"{path.name}{MARK}*")
    assert aside.read_bytes() == whole
    with opened(folder) as parts:  # it is named until somebody has looked
        (problem,) = parts.recovery.problems()
        assert problem.endswith(f"look at {aside.relative_to(folder / 'data')}, then move it away")
        aside.unlink()
        assert parts.recovery.problems() == []


@pytest.mark.parametrize("name", FILES)
def test_a_file_that_may_not_be_read_is_set_aside_and_the_rest_is_served(
    folder: Path, filled: tuple[Path, str], name: str
) -> None:
    lock_up(file_in(folder, name))
    with without_rights(folder):
        check(folder, name, filled[1])


@pytest.mark.parametrize("name", FILES)
def test_damage_on_a_disk_that_is_read_only_is_named_and_the_rest_is_served(
    folder: Path, filled: tuple[Path, str], name: str
) -> None:
    truncate(file_in(folder, name))
    with without_rights(folder):
        for path in (folder, *folder.rglob("*")):
            path.chmod(0o500 if path.is_dir() else 0o400)
        try:
            check(folder, name, filled[1], DATABASES)
        finally:
            for path in (folder, *folder.rglob("*")):
                path.chmod(0o700)


@pytest.mark.parametrize("name", FILES)
def test_damage_on_a_full_disk_is_named_and_the_rest_is_served(
    folder: Path, filled: tuple[Path, str], name: str
) -> None:
    path = file_in(folder, name)
    truncate(path)
    whole = path.read_bytes()
    with full_disk():
        check(folder, name, filled[1], DATABASES)
    if name in DATABASES:  # SQLite reads no file then: the next start finds out
        check(folder, name, filled[1])
    (aside,) = path.parent.glob(f"{path.name}{MARK}*")
    assert aside.read_bytes() == whole


@pytest.mark.parametrize("name", [*WITH_COPY[:5], "events.sqlite"])  # the others may have unknown fields
def test_a_file_of_a_later_version_is_refused_in_words_and_stays(folder: Path, name: str) -> None:
    path = file_in(folder, name)
    for one in (path, copy_of(path)):
        if one.exists():
            make_it_newer(one)
    whole = path.read_bytes()
    with pytest.raises(SettingsError, match=f"(?s){name}.*(install the version that wrote it|move the file away)"):
        Parts(folder)
    assert path.read_bytes() == whole
    assert not list(path.parent.glob(f"*{MARK}*"))


def test_a_history_or_a_checkpoint_of_a_later_version_stays(folder: Path) -> None:
    make_it_newer(file_in(folder, "history.sqlite"))
    newer = CheckpointFolder(folder / "data" / "checkpoints", "later", decode)
    newer.write(Snapshot({}, {"value": 3}))
    with opened(folder) as parts:
        assert not parts.tracks.writer.flush()
        assert "schema version 99" in str(parts.persistence.problems())
        found, complaints = parts.checkpoints.newest()
        assert found is not None
        assert found.document["value"] == 2
        assert "kept as unread-checkpoint" in str(complaints)
        assert parts.recovery.problems() == []


def make_it_newer(path: Path) -> None:
    if path.suffix == ".sqlite":
        with closing(sqlite3.connect(path)) as connection:
            connection.execute("PRAGMA user_version = 99")
        return
    document = orjson.loads(path.read_bytes())
    item = document if path.name.startswith("site.json") else next(iter(document.values()))
    item["of_later"] = True
    path.write_bytes(orjson.dumps(document))


@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize("name", IN_SECURITY)
def test_a_damaged_folder_of_credentials_opens_no_door(folder: Path, name: str, change: Callable[[Path], None]) -> None:
    change(file_in(folder, name))
    if name == "ca.key":  # the service does without it
        with pytest.raises(SecurityError, match="is damaged"):
            SecurityFolder.open(folder / "security").add_tag("lift", 9)
        return
    with pytest.raises(SettingsError, match=rf"security.folder: .*{name} is damaged"):
        Parts(folder)


def test_another_key_ends_all_links(folder: Path, filled: tuple[Path, str]) -> None:
    flip(file_in(folder, "share_key"))
    with opened(folder) as parts:
        assert not is_let_in(parts.links, filled[1])


def test_this_page_knows_every_file(filled: tuple[Path, str]) -> None:
    data = filled[0] / "data"
    found = {str(path.relative_to(data)) for path in data.rglob("*") if path.is_file()}
    found = {"plans/image" if name.endswith(".png") else name for name in found}
    assert {name for name in found if not name.endswith(("-wal", "-shm", COPY))} == {*FILES, *NOT_READ}
    assert {name for name in found if name.endswith(COPY)} == {f"{name}{COPY}" for name in WITH_COPY}
