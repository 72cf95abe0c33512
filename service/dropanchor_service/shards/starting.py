"""Tell the cluster that a shard starts, so that nobody takes it for one that hangs."""

from contextlib import suppress
from pathlib import Path
from threading import Event, Thread

from dropanchor_service.cluster.database import DatabaseError, connect
from dropanchor_service.cluster.leases import ANY, note_standby
from dropanchor_service.cluster.versions import installed
from dropanchor_service.settings.sources import SettingsError, load_settings

SENTENCE = "it is starting"
FAILED = "it has failed: "
NOTE_S = 1.0
EXIT_GONE = 75
BACK_OFF_S = 10.0  # before a process that failed ends: it is restarted at once


class Starting:
    """Says so once a second, from `begin` to `end`. version: that this process runs."""

    def __init__(self, name: str, config: Path) -> None:
        self.version = installed()
        self._name = name
        self._config = config
        self._sentence = SENTENCE
        self._ended = Event()
        self._thread = Thread(target=self._run, name="starting", daemon=True)

    def begin(self) -> None:
        self._thread.start()

    def failed(self, error: Exception) -> None:
        """Say instead why the shard cannot start."""
        self._sentence = f"{FAILED}{' '.join(str(error).split()) or type(error).__name__}"

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
                note_standby(connection, ANY, self._name, self._sentence, self.version, installed())
