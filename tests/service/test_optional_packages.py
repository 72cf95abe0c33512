"""The service where the extra `evaluation`, and what only the engine `paper` needs, is not installed."""

import json
from pathlib import Path

from support.commands import python
from support.recordings import write_square

COMPILING_S = 600.0  # at most, where no kernel is in the cache
EXTRA = ("matplotlib", "scipy", "sympy")
MAPS = ("pmtiles", "pypdfium2", "pyproj", "resvg_py")
SERVICE_AND_ENGINE = """
import dropanchor_service.service
from dropanchor_service.engines.choose import create_engine
from dropanchor_service.engines.warm_up import warm_up_answers, warm_up_ingest
from dropanchor_service.settings.model import Settings
create_engine(Settings(engine="fleet"))
warm_up_ingest()
warm_up_answers()
"""
COMMAND = """
from dropanchor_service.cli import main
sys.exit(main(sys.argv[1:]))
"""


ABSENT = """
import sys
class Absent:
    def __init__(self, *packages):
        self.packages = packages
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in self.packages:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
"""


def without(*packages: str) -> str:
    """Code after which these packages are not to be found."""
    return f"{ABSENT}sys.meta_path.insert(0, Absent(*{packages}))\n"


def test_the_service_with_the_engine_fleet_starts_without_them() -> None:
    absent = (*EXTRA, *MAPS, "dropanchor_evaluation", "filterpy", "psycopg")
    ended = python("-c", without(*absent) + SERVICE_AND_ENGINE, timeout_s=COMPILING_S)
    assert ended.returncode == 0, ended.stderr


def test_the_service_with_the_engine_fleet_leaves_them_alone_where_they_are_installed() -> None:
    """numba imports the package scipy itself, to compare versions, but nothing in it."""
    unused = {"filterpy", "matplotlib", "psycopg", "scipy.linalg", "sympy", *MAPS}
    loaded = f"import sys; print(*{unused} & set(sys.modules))"
    ended = python("-c", SERVICE_AND_ENGINE + loaded, timeout_s=COMPILING_S)
    assert (ended.returncode, ended.stdout.split()) == (0, [])


# What the commands share is imported once: each runs in a copy of this process.
COMMANDS = """
import dropanchor_service.settings.sources, json, os
from dropanchor_service.cli import main
for missing, words in json.loads(sys.argv[1]):
    if os.fork() == 0:
        sys.meta_path.insert(0, Absent(missing))
        sys.exit(main(words))
    print(os.waitstatus_to_exitcode(os.wait()[1]), flush=True)
"""


def test_a_command_that_needs_an_extra_says_how_to_install_it() -> None:
    bag = str(Path(__file__).with_name("importing") / "empty.bag")
    asked = [
        ("dropanchor_evaluation", "evaluation", ["evaluate", "paper"]),
        ("scipy", "evaluation", ["evaluate", "recordings"]),
        ("sympy", "evaluation", ["evaluate", "paper"]),
        ("matplotlib", "evaluation", ["replay", "a folder", "--plot=track.png"]),
        ("pyarrow", "parquet", ["replay", "a folder", "--out=track.parquet"]),
        ("foxglove", "foxglove", ["foxglove"]),
        ("rosbags", "ros2", ["ros2", "--tag=cart"]),
        ("xxhash", "ros2", ["ros2", "--tag=cart"]),
        ("rosbags", "ros2", ["import", "--out=drive", bag]),
        ("psycopg", "postgresql", ["cluster", "status"]),
        ("ray", "cluster", ["cluster", "start", "--join", "--config=yards.toml"]),
    ]
    ended = python("-c", ABSENT + COMMANDS, json.dumps([(missing, words) for missing, _, words in asked]))
    assert ended.stdout.split() == ["2"] * len(asked), ended.stderr
    assert ended.stderr.splitlines() == [
        f"This needs the extra '{extra}': pip install 'dropanchor-service[{extra}]' (in a clone: make install)"
        for _, extra, _ in asked
    ]


def test_a_replay_without_a_picture_needs_no_extra(tmp_path: Path) -> None:
    replay = ("replay", str(write_square(tmp_path)), "--anchor=A")
    ended = python("-c", without(*EXTRA, "dropanchor_evaluation", "filterpy") + COMMAND, *replay, timeout_s=COMPILING_S)
    assert ended.returncode == 0
    assert "RMSE" in ended.stdout


def test_a_recording_in_parquet_without_the_extra_says_how_to_install_it(tmp_path: Path) -> None:
    (write_square(tmp_path) / "range.parquet").write_bytes(b"")
    (tmp_path / "range.csv").unlink()
    ended = python("-c", without("pyarrow") + COMMAND, "replay", str(tmp_path), "--anchor=A")
    assert ended.returncode == 2
    assert "Parquet needs the extra `parquet`: pip install 'dropanchor-service[parquet]'" in ended.stderr


def test_a_service_without_the_extra_mqtt_delivers_otherwise_and_says_how_to_install_it() -> None:
    check = """
from dropanchor_schemas.destinations import MqttDestination
from dropanchor_service.delivery.channels import Channels
from dropanchor_service.settings.events import DeliverySettings, EmailSettings, MqttSettings
channels = Channels(DeliverySettings(), EmailSettings(), MqttSettings(server="broker"))
try:
    channels.check(MqttDestination(type="mqtt", id="mes"))
except ValueError as error:
    print(error)
"""
    ended = python("-c", without("paho") + check)
    assert (ended.returncode, ended.stdout) == (
        0,
        "MQTT needs the extra `mqtt`: pip install 'dropanchor-service[mqtt]'\n",
    ), ended.stderr


def test_a_service_without_the_extra_parquet_exports_otherwise_and_says_how_to_install_it() -> None:
    check = """
import tempfile
from pathlib import Path
sys.path.insert(0, sys.argv[1])
from service.api.routes.test_track import driven
from support.api import ask
with tempfile.TemporaryDirectory() as folder:
    app = driven(Path(folder)).app()
    for form in ("csv", "parquet"):
        answer = ask(app, "GET", f"/api/v1/tags/a/track/file?format={form}")
        print(answer.status_code, answer.json()["detail"] if form == "parquet" else "")
"""
    ended = python("-c", without("pyarrow") + check, str(Path(__file__).parents[1]))
    assert (ended.returncode, ended.stdout) == (
        0,
        "200 \n409 Parquet needs the extra `parquet`: pip install 'dropanchor-service[parquet]'\n",
    ), ended.stderr


def test_checkpoints_outside_the_database_need_an_extra_and_the_node_says_so(tmp_path: Path) -> None:
    config = tmp_path / "yards.toml"
    lines = [
        'cluster.url = "postgresql://db.example/a"',
        'cluster.checkpoints = "s3://shared"',
        'cluster.bucket = "yard"',
    ]
    config.write_text("\n".join([*lines, 'zenoh.connect = ["tcp/127.0.0.1:9"]']) + "\n")
    for missing, sentence in (
        ("fsspec", "cluster.checkpoints needs the extra `s3`: pip install 'dropanchor-service[s3]'"),
        ("s3fs", "cluster.checkpoints: s3://shared cannot be used: Install s3fs to access S3"),
    ):
        command = ("cluster", "start", "--join", f"--config={config}", f"--folder={tmp_path}")
        ended = python("-c", without(missing) + COMMAND, *command)
        assert (ended.returncode, ended.stderr) == (2, f"dropanchor cluster: {sentence}\n")


def test_floor_plans_without_the_extra_maps_are_pictures_and_the_rest_says_how_to_install_it() -> None:
    check = """
from io import BytesIO
from PIL import Image
from dropanchor_schemas.site import Georeference
from dropanchor_service.plans.reading.messages import Request
from dropanchor_service.plans.reading.read_plan import read_plan
from dropanchor_service.plans.reading.refused import RefusedError
file = BytesIO()
Image.new("RGB", (40, 20)).save(file, "PNG")
world, origin = [0.05, 0, 0, -0.05, 389500.025, 5819999.975], Georeference(lat=52.5, lon=13.4)
for crs in ("", "site", "EPSG:25833"):
    request = Request(media_type="image/png", world=world if crs else None, crs=crs, georeference=origin)
    found = read_plan(file.getvalue(), request).description
    print(found.width_px, found.note)
for media_type in ("application/pdf", "image/svg+xml"):
    try:
        read_plan(b"", Request(media_type=media_type))
    except RefusedError as error:
        print(error)
"""
    ended = python("-c", without(*MAPS) + check)
    assert ended.stdout.splitlines() == [
        "40 ",
        "40 The image does not lie within 100 km of the site's origin. Is its coordinate system right?",
        "40 EPSG:25833 needs the extra `maps`: pip install 'dropanchor-service[maps]'",
        *2 * ("PDF and SVG need the extra `maps`: pip install 'dropanchor-service[maps]'.",),
    ], ended.stderr


def test_a_base_map_without_the_extra_maps_stops_the_start_and_says_how_to_install_it(tmp_path: Path) -> None:
    config = tmp_path / "site.toml"
    config.write_text(f'basemap.tiles = "{tmp_path}/map.pmtiles"\n')
    ended = python("-c", without(*MAPS) + COMMAND, "serve", f"--config={config}", "--port=0", timeout_s=COMPILING_S)
    sentence = "basemap.tiles needs the extra `maps`: pip install 'dropanchor-service[maps]'"
    assert (ended.returncode, ended.stderr.splitlines()[-1]) == (2, f"dropanchor serve: {sentence}")
