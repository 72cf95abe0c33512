"""Open the black box of a service as the settings want it, beside what else observes the ingest."""

from collections.abc import Callable
from pathlib import Path

from dropanchor_schemas.file_names import file_name_of
from dropanchor_service.blackbox.block import Messages
from dropanchor_service.blackbox.box import BlackBox
from dropanchor_service.blackbox.pieces import FOLDER, Limits
from dropanchor_service.checkpoints.snapshot import ServiceState
from dropanchor_service.ingest.observers import Observers
from dropanchor_service.settings.model import Settings
from dropanchor_service.store import Sites


def open_box(
    settings: Settings,
    sites: Sites,
    state: ServiceState | None,
    now_ns: Callable[[], int],
) -> BlackBox | None:
    """Return the black box, None without a place for it; see `BlackBox`."""
    wanted, folder = settings.blackbox, settings.data_dir
    if folder is None or not wanted.enabled:
        return None
    limits = Limits(int(wanted.max_mib * 2**20), round(wanted.keep_hours * 3600e9))
    where = box_folder(folder, settings.cluster.bucket)
    return BlackBox(where, limits, sites, state, now_ns, settings.of_replays)


def box_folder(data_dir: Path, bucket: str | None) -> Path:
    """Return the folder of a black box. Processes that share a data folder have a bucket each."""
    return data_dir / FOLDER if bucket is None else data_dir / FOLDER / file_name_of(bucket)


def beside(box: BlackBox | None, observers: Observers) -> Observers:
    """Return observers that pass the messages to a black box, too."""
    if box is None:
        return observers

    def on_messages(messages: Messages) -> None:
        box.on_messages(messages)
        observers.messages(messages)

    return Observers(on_messages, observers.poses)
