"""What one site has on disk: its table, floor plans, history, recordings and more, as the settings enable them."""

import logging
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Self

from dropanchor_service.basemap.errors import UnusableFileError
from dropanchor_service.estimation.columns import Array
from dropanchor_service.history.errors import HistoryError
from dropanchor_service.history.sqlite.store import SqliteStorage
from dropanchor_service.history.storage import Retention, Storage
from dropanchor_service.history.tracks import Tracks
from dropanchor_service.ingest.observers import NO_OBSERVERS, Observers
from dropanchor_service.persistence.site_files import folder_of_site
from dropanchor_service.plans.floors import follow_floors
from dropanchor_service.plans.store import PlanStore
from dropanchor_service.recording.folder import Limits
from dropanchor_service.recording.recorder import Recorder
from dropanchor_service.runtime.recovery import NewerFileError, Recovery, copy_of
from dropanchor_service.settings.history import HistorySettings, RecordingSettings
from dropanchor_service.settings.layers import Layer
from dropanchor_service.settings.model import Settings
from dropanchor_service.settings.sources import SettingsError
from dropanchor_service.store import Sites, SiteStore, TagTable
from dropanchor_service.store.omlox_items import OmloxItems
from dropanchor_service.store.site import FILE_NAME

if TYPE_CHECKING:
    from dropanchor_service.basemap.basemap import ServedBasemap
    from dropanchor_service.history.postgresql.database import Database

_log = logging.getLogger(__name__)


class Persistence:
    """Floor plans, what omlox clients have stored, and the history (`tracks`) and the recorder.

    The last two are None when disabled. They write while this context is open. Creating it raises SettingsError when a
    file is of a later version.
    """

    def __init__(
        self,
        settings: Settings,
        tags: TagTable,
        site: SiteStore,
        now_ns: Callable[[], int],
        database: "Database | None" = None,
        recovery: Recovery | None = None,
    ) -> None:
        """settings: as of an only site; see `settings_of`. database: of the history; None where it is in a file.

        recovery: reports files that are damaged.
        """
        recovery = recovery or Recovery()
        self._settings = settings
        self._opened = ExitStack()
        self.plans = _open_plans(settings.data_dir, recovery)
        follow_floors(self.plans, site)
        self.tracks: Tracks | None = None
        self.recorder: Recorder | None = None
        self.omlox = _open_omlox(settings, recovery)
        storage = _open_storage(settings, site, now_ns, database, recovery)
        if storage is not None:
            self.tracks = Tracks(storage, retention_of(settings.history), tags, site)
        folder = settings.data_dir
        if folder is None:
            return
        period_ns = round(settings.recording.pose_period_s * 1e9)
        limits, metadata = file_limits_of(settings.recording), settings.of_replays
        self.recorder = Recorder(folder, limits, period_ns, tags, site, now_ns, metadata)

    def __enter__(self) -> Self:
        for writer in (self.tracks, self.recorder):
            if writer is not None:
                self._opened.enter_context(writer)
        if self.recorder is not None and self._settings.recording.enabled:
            self.recorder.start(self._settings.recording.tags)
        return self

    def __exit__(self, *_: object) -> None:
        self._opened.close()

    @property
    def observers(self) -> Observers:
        """The observers that pass messages and poses of the ingest to the history and the recorder."""
        tracks, recorder = self.tracks, self.recorder

        def on_poses(poses: Array) -> None:
            if tracks is not None:
                tracks.offer(poses)
            if recorder is not None:
                recorder.record_poses(poses)

        if tracks is None and recorder is None:
            return NO_OBSERVERS
        return Observers(NO_OBSERVERS.messages if recorder is None else recorder.record_messages, on_poses)

    def problems(self) -> Sequence[str]:
        """Return why the history and the recorder cannot write."""
        of_tracks = [] if self.tracks is None else self.tracks.problems
        of_recorder = None if self.recorder is None else self.recorder.writer.problem
        return [*of_tracks, *([] if of_recorder is None else [of_recorder])]


def open_database(settings: Settings, now_ns: Callable[[], int]) -> "Database | None":
    """Return the database of the history, None where it is in files. Nothing connects yet. Raises SettingsError."""
    history = settings.history
    if history.url is None or not history.enabled:
        return None
    try:
        from dropanchor_service.history.postgresql.database import Database
    except ImportError as error:
        sentence = "history.url needs the extra `postgresql`: pip install 'dropanchor-service[postgresql]'"
        raise SettingsError(sentence) from error
    try:
        return Database(history.url, history.password_file, now_ns)
    except HistoryError as error:
        raise SettingsError(f"history.url: {error}") from error


def _open_storage(
    settings: Settings,
    site: SiteStore,
    now_ns: Callable[[], int],
    database: "Database | None",
    recovery: Recovery,
) -> Storage | None:
    retention = retention_of(settings.history)
    if not settings.history.enabled:
        return None
    if database is not None:
        from dropanchor_service.history.postgresql.store import PostgresqlStorage

        return PostgresqlStorage(database, site.site.id, retention, now_ns, lambda: site.epoch)
    return None if settings.data_dir is None else SqliteStorage(settings.data_dir, retention, now_ns, recovery)


def retention_of(settings: HistorySettings) -> Retention:
    """Return which poses the history keeps, in its units."""
    return Retention(
        period_ns=round(settings.period_s * 1e9),
        distance_m=settings.distance_m,
        still_ns=round(settings.still_s * 1e9),
        keep_ns=round(settings.keep_days * 86_400e9),
        max_bytes=int(settings.max_mib * 2**20),
    )


def file_limits_of(settings: RecordingSettings) -> Limits:
    """Return when a file of a recording is full and which files are kept, in the recorder's units."""
    return Limits(
        file_bytes=int(settings.file_mib * 2**20),
        file_ns=round(settings.file_minutes * 60e9),
        keep_files=settings.keep_files,
        keep_ns=round(settings.keep_days * 86_400e9),
        max_bytes=int(settings.max_mib * 2**20),
    )


def _open_plans(folder: Path | None, recovery: Recovery) -> PlanStore:
    try:
        return PlanStore(folder, recovery)
    except NewerFileError as error:
        raise SettingsError(f"data_dir: {error}") from error


def open_site(settings: Settings, recovery: Recovery | None = None) -> SiteStore:
    """Return the site, as the settings and the data folder have it. Raises SettingsError.

    recovery: reports a file that is damaged.
    """
    try:
        store = SiteStore(settings.site, settings.listed_tags, settings.data_dir, settings.tag_defaults, recovery)
    except NewerFileError as error:
        raise SettingsError(f"data_dir: {error}") from error
    store.layers = settings.layers
    return store


def saved_site(settings: Settings, name: str) -> SiteStore:
    """Return a site as a service with these settings would have it, and change nothing. Raises SettingsError."""
    own = settings_of(settings, name)
    store = open_site(own.model_copy(update={"data_dir": None}))
    folder = settings.data_dir
    if folder is None or own.data_dir is None:
        return store
    before_it_moves = folder if settings.sites else folder_of_site(folder, name)
    for path in (own.data_dir / FILE_NAME, copy_of(own.data_dir / FILE_NAME), before_it_moves / FILE_NAME):
        try:
            store.share(path.read_bytes(), lambda _: None)
            break
        except FileNotFoundError:
            continue
        except (OSError, ValueError) as error:
            _log.warning("%s cannot be read: %s", path, error)
    return store


def open_sites(settings: Settings, recovery: Recovery | None = None) -> Sites:
    """Return the sites, as the settings and the data folder have them; see `open_site`. Raises SettingsError."""
    if not settings.sites:
        return Sites([(_open_only_site(settings, recovery), settings.quota)])
    stores = [open_site(settings_of(settings, name), recovery) for name in settings.sites]
    for name, store in zip(settings.sites, stores, strict=True):
        if (owner := store.values.site.id) != name:
            raise SettingsError(f"data_dir: the folder of the site {name!r} holds the files of {owner!r}")
    quotas = [site.quota(settings.quota) for site in settings.sites.values()]
    return Sites(list(zip(stores, quotas, strict=True)))


def _open_only_site(settings: Settings, recovery: Recovery | None) -> SiteStore:
    """Return the only site. What another one has left in the data folder is its own from now on."""
    store = open_site(settings, recovery)
    if (former := store.values.site.id) != settings.site.id:
        _log.warning(
            "the site %r is %r now, as the settings say: tags must use this id in their keys, or set site.id",
            former,
            settings.site.id,
        )
        try:
            store.take_over()
        except OSError as error:
            _log.error("the new id of the site cannot be saved: %s", error)
    return store


def settings_of(settings: Settings, name: str) -> Settings:
    """Return the settings of this site as those of an only site. One of `[sites]` has its files in its own folder."""
    if not settings.sites:
        return settings
    site, folder = settings.sites[name], settings.data_dir
    own = {
        "site": site.site.model_copy(update={"id": name}),
        "tags": site.tags,
        "tag_defaults": site.tag_defaults.over(settings.tag_defaults),
        "data_dir": None if folder is None else folder_of_site(folder, name),
    }
    return settings.model_copy(update=own).loaded_from(_layers_of(settings, name))


def _layers_of(settings: Settings, name: str) -> list[Layer]:
    """Return the layers of one of several sites: what its table does not hold is as at the top level."""
    shared = [layer._replace(values={"tag_defaults": layer.values.get("tag_defaults")}) for layer in settings.layers]
    return [*shared, *(layer.below("sites", name) for layer in settings.layers)]


def _open_omlox(settings: Settings, recovery: Recovery) -> OmloxItems:
    """Return what omlox clients have stored. Raises SettingsError."""
    try:
        return OmloxItems.opened(settings.data_dir, recovery)
    except NewerFileError as error:
        raise SettingsError(f"data_dir: {error}") from error


def open_basemap(settings: Settings, sites: Sequence[SiteStore]) -> "ServedBasemap | None":
    """Return the base map of these sites; None without one. Raises SettingsError."""
    path = settings.basemap.tiles
    if path is None:
        return None
    try:
        from dropanchor_service.basemap.basemap import ServedBasemap

        basemap = ServedBasemap(path, settings.basemap.attribution)
    except ModuleNotFoundError as error:
        sentence = "basemap.tiles needs the extra `maps`: pip install 'dropanchor-service[maps]'"
        raise SettingsError(sentence) from error
    except OSError as error:
        raise SettingsError(f"basemap.tiles: {path} cannot be read: {error.strerror}") from error
    except UnusableFileError as error:
        raise SettingsError(f"basemap.tiles: {error}") from error
    if all(site.site.georeference is None for site in sites):
        _log.warning(
            "basemap.tiles: %s, so the page shows no base map until it has",
            "the site has no latitude and longitude" if len(sites) == 1 else "no site has latitude and longitude",
        )
    return basemap
