"""Each of several sites has its own floor plans, history and recordings, in its own folder."""

from pathlib import Path

import numpy as np
import pytest
from prometheus_client import generate_latest

from dropanchor_schemas.wire import ENCODING_JSON
from dropanchor_service.basemap.errors import UnreadableTileError
from dropanchor_service.estimation.columns import POSE, State
from dropanchor_service.metrics.registry import Metrics
from dropanchor_service.persistence.site import open_sites
from dropanchor_service.persistence.site_folders import SiteFolders
from dropanchor_service.recording.reading import RecordingReader
from dropanchor_service.settings.basemap import BasemapSettings
from dropanchor_service.settings.model import Settings
from dropanchor_service.settings.sources import load_settings
from support.basemap_files import basemap_file, image_tile

S = 1_000_000_000
T = 1_760_000_000 * S


def settings_in(folder: Path) -> Settings:
    return load_settings(options={"data_dir": str(folder), "sites": {"north": {}, "Lager Süd": {}}}, environment={})


def test_poses_and_messages_reach_the_files_of_their_site_alone(tmp_path: Path) -> None:
    settings, metrics = settings_in(tmp_path), Metrics()
    sites = open_sites(settings)
    rows = [site.tags.register("cart").row for site in sites] + [sites[0].tags.register("lift").row]
    poses = np.zeros(3, POSE)
    poses["row"], poses["x"], poses["t_ns"], poses["state"] = rows, [1.0, 2.0, 3.0], T, State.TRACKING
    with SiteFolders(settings, sites, lambda: T, metrics) as folders:
        south = folders.all[1].recorder
        assert south is not None
        assert south.start()
        folders.observers.messages([(row, b"{}", ENCODING_JSON, T) for row in rows])
        folders.observers.poses(poses)
        assert folders.problems() == []
        for one in folders.all:
            assert one.tracks is not None
            assert one.tracks.writer.flush()
        found = []
        for one in folders.all:
            assert one.tracks is not None
            found.append(
                {tag: one.tracks.reader.poses(tag, 0, 2 * T, 9).poses["x"].tolist() for tag in one.tracks.reader.tags()}
            )
        assert found == [{"cart": [1.0], "lift": [3.0]}, {"cart": [2.0]}]
    assert [one.recorder.files() != [] for one in folders.all if one.recorder] == [False, True]
    (file,) = (tmp_path / "sites" / "Lager%20S%C3%BCd" / "recordings").glob("*.mcap")
    turns = list(RecordingReader(file).turns())
    assert [message[0] for turn in turns for message in turn.messages] == ["cart"]
    assert [tag for turn in turns for tag, _ in turn.estimates] == ["cart"]
    assert (tmp_path / "sites" / "north" / "history.sqlite").exists()
    assert not (tmp_path / "history.sqlite").exists()
    text = generate_latest(metrics.registry).decode()
    assert "dropanchor_history_poses_total 3.0" in text
    assert text.count("# TYPE dropanchor_recording_running") == 1


def test_all_sites_share_one_base_map_which_closes_with_the_service(tmp_path: Path) -> None:
    tiles = basemap_file(tmp_path / "map.pmtiles", {(0, 0, 0): image_tile((1, 2, 3))})
    settings = settings_in(tmp_path / "data").model_copy(update={"basemap": BasemapSettings(tiles=tiles)})
    sites = open_sites(settings)
    with SiteFolders(settings, sites, lambda: T, Metrics()) as folders:
        assert folders.basemap is not None
        assert folders.basemap.file.tile(0, 0, 0) is not None
    with pytest.raises(UnreadableTileError):
        folders.basemap.file.tile(0, 0, 0)
