"""Clients in Python and TypeScript that are generated from the document of the omlox interface, on a real server."""

import importlib
import json
import subprocess
import sys
from pathlib import Path
from typing import Any
from uuid import UUID

import pytest

from support.events import circle
from support.node_packages import install
from support.omlox import OmloxBench
from support.patience import PATIENCE_S

GENERATOR = "openapi_python_client"
NODE_PACKAGES = ("openapi-typescript@7.13.0", "openapi-fetch@0.17.0", "typescript@5.9.3")

TYPESCRIPT = """\
import createClient from "openapi-fetch";
import type { components, paths } from "./omlox.js";

type Trackable = components["schemas"]["Trackable"];
type News = { event: string; payload?: components["schemas"]["TrackableMotion"][] };

const address = process.argv[2];
const client = createClient<paths>({ baseUrl: `http://${address}/omlox/v2` });

const { data: trackables } = await client.GET("/trackables/summary");
const own: Trackable = trackables![0];
const path = { trackable_id: own.id! };
const { data: location } = await client.GET("/trackables/{trackable_id}/location", {
    params: { path, query: { crs: "local" } },
});
if (!location || !("position" in location)) throw new Error("no location");
const { data: made } = await client.POST("/trackables", { body: { type: "virtual", name: "Truck" } });
const { error } = await client.GET("/trackables/{trackable_id}/location", {
    params: { path: { trackable_id: made!.id! } },
});
const { data: fences } = await client.GET("/fences");

const socket = new WebSocket(`ws://${address}/omlox/v2/ws/socket`);
socket.onopen = () => socket.send(JSON.stringify({ event: "subscribe", topic: "trackable_motions" }));
socket.onmessage = ({ data }) => {
    const { event, payload } = JSON.parse(data) as News;
    if (event === "subscribed") {
        console.log(JSON.stringify({ own, coordinates: location.position.coordinates, error, fences }));
        return;
    }
    console.log(JSON.stringify({ moved: payload![0].id }));
    socket.close();
};
"""


@pytest.fixture
def bench() -> OmloxBench:
    bench = OmloxBench()
    bench.poses.move("tag-1", x=5.0, y=2.0)
    bench.zones.put(circle("dock"))
    return bench


def document(bench: OmloxBench, folder: Path) -> Path:
    file = folder / "omlox.json"
    file.write_text(json.dumps(bench.get("openapi.json")))
    return file


def generated_python(file: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Return a function that imports a module of the client generated from the document."""
    config = file.with_name("config.yml")
    config.write_text("post_hooks: []\n")
    command = [sys.executable, "-m", GENERATOR, "generate", "--path", str(file), "--config", str(config)]
    package = file.with_name("omlox_generated")
    done = subprocess.run(
        [*command, "--output-path", str(package), "--meta", "none", "--fail-on-warning"],
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    monkeypatch.syspath_prepend(str(file.parent))
    return lambda name: importlib.import_module(f"omlox_generated.{name}")


def test_a_generated_python_client_reads_and_changes_the_hub(
    bench: OmloxBench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    module = generated_python(document(bench, tmp_path), monkeypatch)
    models = module("models")

    def api(name: str) -> Any:
        return module(f"api.{name}")

    with bench.running() as port, module("client").Client(f"http://127.0.0.1:{port}/omlox/v2") as client:
        (own,) = api("trackables.list_trackables").sync(client=client)
        assert own.location_providers == ["tag-1"]
        location = api("trackables.get_trackable_location").sync(own.id, client=client)
        assert isinstance(location, models.Location)
        assert location.provider_type == "uwb"
        assert location.properties["state"] == "tracking"
        (zone, _) = api("zones.list_zones").sync(client=client)
        assert zone.foreign_id == "17"
        (fence,) = api("fences.list_fences").sync(client=client)
        assert fence.radius == 5.0
        truck = models.Trackable.from_dict({"type": "virtual", "name": "Truck", "location_providers": ["tag-1"]})
        made = api("trackables.create_trackable").sync(client=client, body=truck)
        assert isinstance(made.id, UUID)
        (motion,) = api("trackables.list_motions").sync(client=client)
        assert (motion.id, motion.name) == (made.id, "Truck")
        gone = api("trackables.get_trackable").sync(own.id, client=client)
        assert isinstance(gone, models.OmloxProblem)
        assert gone.code == 404


def test_a_generated_typescript_client_reads_and_follows_the_hub(bench: OmloxBench, tmp_path: Path) -> None:
    install(tmp_path, *NODE_PACKAGES, "@types/node@20")
    file = document(bench, tmp_path)
    programs = tmp_path / "node_modules" / ".bin"
    (tmp_path / "client.ts").write_text(TYPESCRIPT)
    run(tmp_path, programs / "openapi-typescript", file.name, "-o", "omlox.ts")
    strict = ("--strict", "--skipLibCheck", "--target", "es2022", "--lib", "es2022,dom")
    run(tmp_path, programs / "tsc", *strict, "--module", "nodenext", "--moduleResolution", "nodenext", "client.ts")
    with bench.running() as port:
        command = ["node", "--experimental-websocket", "client.js", f"127.0.0.1:{port}"]
        with subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, text=True) as client:
            assert client.stdout is not None
            seen = json.loads(client.stdout.readline())
            bench.poses.move("tag-1", x=6.0)
            moved = json.loads(client.stdout.readline())
            assert client.wait(PATIENCE_S) == 0
    assert seen["own"]["location_providers"] == ["tag-1"]
    assert seen["coordinates"] == [5.0, 2.0, 0.0]
    assert (seen["error"]["code"], seen["error"]["type"]) == (404, "urn:dropanchor:problem:no-location")
    assert len(seen["fences"]) == 1
    assert moved == {"moved": seen["own"]["id"]}


def run(folder: Path, program: Path, *arguments: str) -> None:
    done = subprocess.run(
        [str(program), *arguments], cwd=folder, capture_output=True, text=True, timeout=PATIENCE_S, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
