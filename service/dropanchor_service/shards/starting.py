"""Tell the cluster that a shard starts, so that nobody takes it for one that hangs."""

from contextlib import suppress
from pathlib import Path
from threading import Event, Thread

from dropanchor_service.cluster.database import DatabaseError, connect
from dropanchor_service.cluster.leases import ANY, note_standby
from dropanchor_service.settings.sources import SettingsError, load_settings

SENTENCE = "it is starting"
NOTE_S = 1.0


class Starting:
    """Says so once a second, from `begin` to `end`."""

    def __init__(self, name: str, config: Path) -> None:
        self._name = name
        self._config = config
        self._ended = Event()
        self._thread = Thread(target=self._run, name="starting", daemon=True)

    def begin(self) -> None:
        self._thread.start()

    def end(self) -> None:
        """Return when nothing more is said."""
        self._ended.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._ended.is_set():
            with suppress(DatabaseError, SettingsError):  # the shard itself reports them
                self._say()
            self._ended.wait(NOTE_S)

    def _say(self) -> None:
        with connect(load_settings(self._config).cluster.url or "", self._name) as connection:
            while not self._ended.wait(NOTE_S):
                note_standby(connection, ANY, self._name, SENTENCE)
