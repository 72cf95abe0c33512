"""What contract tests of REST share: an application with all its parts, and rules that a schema cannot express."""

import atexit
from datetime import UTC, datetime
from pathlib import Path

import schemathesis
from fastapi import FastAPI
from hypothesis import strategies as st
from schemathesis.specs.openapi.checks import negative_data_rejection, positive_data_acceptance

from dropanchor_schemas.keys import NOT_IDS
from dropanchor_schemas.site import Anchor, Georeference, Site
from dropanchor_schemas.wire import ENCODING_PACKED
from dropanchor_service.basemap.basemap import ServedBasemap
from dropanchor_service.history.storage import Retention
from dropanchor_service.recording.folder import Limits
from dropanchor_service.recording.recorder import Recorder
from support.api import make_api_bench
from support.basemap_files import basemap_file, image_tile

OF_SITE = "_of_site"
BEYOND_THE_SCHEMA = {
    "delete_anchor": [positive_data_acceptance],
    "delete_tag": [positive_data_acceptance],
    "get_basemap_tile": [positive_data_acceptance],
    "get_pose": [positive_data_acceptance],
    "get_track": [positive_data_acceptance],
    "get_figures": [positive_data_acceptance],
    "get_heat_map": [positive_data_acceptance],
    "get_history_coverage": [positive_data_acceptance],
    "list_features": [positive_data_acceptance],
    "list_events": [positive_data_acceptance],
    "list_changes": [positive_data_acceptance],
    "get_changes_file": [positive_data_acceptance],
    "get_tracks": [positive_data_acceptance],
    "get_samples": [positive_data_acceptance],
    "explain_pose": [positive_data_acceptance],
    "run_again": [positive_data_acceptance],
    "export_track": [positive_data_acceptance],
    "patch_remote_settings": [positive_data_acceptance],
    "put_anchor": [positive_data_acceptance],
    "put_site": [positive_data_acceptance],
    "put_tag_settings": [positive_data_acceptance],
    "put_zone": [positive_data_acceptance],
    "put_plan": [positive_data_acceptance],
    "delete_plan": [positive_data_acceptance],
    "upload_plan_image": [positive_data_acceptance],
    "put_destination": [positive_data_acceptance],
    "put_event_rule": [positive_data_acceptance],
    "delete_zone": [positive_data_acceptance],
    "delete_destination": [positive_data_acceptance],
    "delete_event_rule": [positive_data_acceptance],
    "allow_receiver_network": [positive_data_acceptance],
    "remove_receiver_network": [positive_data_acceptance],
    "create_key": [positive_data_acceptance],
    "create_share": [positive_data_acceptance],
    "revoke_share": [positive_data_acceptance],
    "ingest_health": [positive_data_acceptance],
    "get_phyphox_code": [positive_data_acceptance],
    "get_phyphox_experiment": [positive_data_acceptance],
    "ingest_phyphox": [positive_data_acceptance, negative_data_rejection],
    "ingest_samples": [positive_data_acceptance],
    "ingest_sensor_logger": [positive_data_acceptance, negative_data_rejection],
}
"""Rules that a schema cannot express: a tile lies within its zoom level; `from` and `to` are at most 31 days
apart, or an hour or half of one; a time is not in seconds; each anchor is listed once; without credentials a
request names the tag; a message holds a sample or a value; `If-Match` is the current tag of a resource; edges do
not cross; an image is one, and was uploaded; a URL is public and a secret long; share links need access control.
And that Sensor Logger's 499 is a refusal."""

IDS = st.text(st.characters(exclude_categories=["C", "Z"], include_characters=" "), min_size=1, max_size=64)
IDS = IDS.filter(lambda one: one.isprintable() and one not in NOT_IDS)
schemathesis.openapi.format("dropanchor-id", IDS)
schemathesis.openapi.format(
    "dropanchor-ids",
    st.lists(IDS.filter(lambda one: "," not in one), min_size=1).map(",".join).filter(lambda ids: len(ids) <= 64),
)
LABELS = st.text(st.characters(exclude_categories=["C", "Z"], include_characters=" "), max_size=64)
schemathesis.openapi.format("dropanchor-label", LABELS.filter(str.isprintable))
TIMES = st.datetimes(datetime(1971, 1, 1), datetime(2200, 1, 1), timezones=st.just(UTC))
schemathesis.openapi.format("date-time", TIMES.map(datetime.isoformat))


def contract_app(folder: Path, site: str = "default") -> FastAPI:
    """Return an application whose site has a tag, a history, a recording and a base map. Its streams end at once."""
    folder.mkdir(exist_ok=True)
    georeference = Georeference(lat=52.5, lon=13.4)
    of_site = Site(id=site, anchors=[Anchor(id="17")], georeference=georeference)
    bench = make_api_bench(of_site, folder, Retention(1, 0.0, 0, 10**18, 2**40))
    limits = Limits(2**30, 10**18, 1000, 10**18, 2**40)
    bench.recorder = Recorder(folder, limits, 1, bench.answers.tags, bench.answers.site, bench.answers.now_ns, {})
    bench.recorder.start()
    bench.move("tag-1", "a")
    bench.write_history()
    bench.recorder.record_messages([(0, b"payload", ENCODING_PACKED, bench.now_ns)])
    bench.recorder.writer.flush()
    bench.stopping.set()  # a stream ends after its first event
    basemap = ServedBasemap(basemap_file(folder / "map.pmtiles", {(0, 0, 0): image_tile((0, 0, 0))}), None)
    atexit.register(basemap.file.close)  # the application is freed any time after the tests of its module
    return bench.app(basemap=basemap)
