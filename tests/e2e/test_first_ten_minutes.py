"""The first ten minutes of a new user, with the very commands of the README and the page."""

import json
import re
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

from dropanchor_tag_client import TagClient
from support.guides import ADDRESS, run
from support.patience import PATIENCE_S
from support.recordings import write_square
from support.samples import samples
from support.service import ROOT, Running, environment, running_service
from support.zenoh_router import free_port, wait_until

README = (ROOT / "README.md").read_text()
SERVE = ".venv/bin/dropanchor"
TAG_README = (ROOT / "tag_client" / "README.md").read_text()


def snippet(text: str, endpoint: str) -> str:
    """Return the only Python program in a Markdown text, with its client connected to the endpoint."""
    (program, *_) = re.findall(r"^```python\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)
    connected = re.sub(r'TagClient\(("[^"]+").*?\)', rf'TagClient(\1, connect="{endpoint}")', program, count=1)
    assert connected != program
    return str(connected)


def shell(line: str, **options: Any) -> None:
    """Run a command line as in a new terminal, without the environment of the service."""
    bare = {"PATH": "/usr/bin:/bin", "PYTHONPATH": environment()["PYTHONPATH"]}
    subprocess.run(["sh", "-c", line], check=True, timeout=PATIENCE_S, env=bare, capture_output=True, **options)


def tags(service: Running) -> dict[str, dict[str, Any]]:
    return {tag["tag"]: tag for tag in service.get("/api/v1/tags")["tags"]}


def test_every_documented_way_to_start_a_tag_uses_the_same_anchor(tmp_path: Path) -> None:
    with running_service() as service:
        for text in (README, TAG_README):
            program = snippet(text, service.zenoh)
            subprocess.run([sys.executable, "-c", program], check=True, timeout=PATIENCE_S, env=environment())
        command = service.get("/api/v1/connect")["simulate"]
        assert command.startswith("/")
        assert service.zenoh in command
        shell(f"{command} --duration 3", cwd=tmp_path)
        wait_until(lambda: tags(service).get("sim-1", {}).get("samples", {}).get("range", 0) > 10)
        found = tags(service)
        assert {"forklift-7", "cart-1", "sim-1"} <= set(found)
        assert [tag["rejected"] for tag in found.values()] == [{}] * len(found)
        assert [anchor["id"] for anchor in service.get("/api/v1/site")["anchors"]] == ["1"]


def test_the_lines_of_the_readme_do_what_it_says(tmp_path: Path) -> None:
    """They are run in its order; only the addresses of the service are others."""
    (tmp_path / ".venv").symlink_to(sys.prefix)
    (program,) = (one for one in samples("python") if one.page == "README.md")
    scripts = [one for one in samples("sh") if one.page == "README.md"]
    starting = [one for one in scripts if re.search("make |dropanchor serve", one.text)]  # they run until stopped
    assert [one.text.splitlines()[0].split()[0] for one in starting] == ["make", SERVE, SERVE]
    lines = [line for one in scripts if one not in starting for line in one.text.splitlines()]
    needed = "A position needs about 20 s of ranges and of motion samples"
    with running_service("--data-dir", str(tmp_path / "FOLDER")) as service:
        (tmp_path / "tag.py").write_text(program.text.replace("tcp/127.0.0.1:7447", service.zenoh))
        send = ".venv/bin/python tag.py"
        assert send in README
        run(send, tmp_path)
        elsewhere = {ADDRESS: service.url, " publish ": f" publish --connect {service.zenoh} "}
        elsewhere |= {f" record {action}": f" record {action} --url {service.url}" for action in ("start", "stop")}
        said = ""
        for line in lines:
            if "curl" in line:  # a person takes longer to type it than the tag sends
                wait_until(lambda: service.ask("GET", "/api/v1/tags/forklift-7/track").json().get("poses"))
                wait_until(lambda: needed in service.get("/api/v1/tags/forklift-7/pose")["hint"])
            for usual, other in elsewhere.items():
                line = line.replace(usual, other)
            said += run(line, tmp_path)
            if "record start" in line:
                run(send, tmp_path)
    assert '"state":"initialising"' in said
    assert needed in said
    assert re.search(r"t_ns,t_utc,.*\n\d+,", said)
    assert "forklift-7: 1 poses" in said


def test_a_tag_whose_samples_are_a_minute_old_is_initialising_and_not_lost() -> None:
    with running_service() as service, TagClient("long-ago", connect=service.zenoh) as tag:
        a_minute_ago_ns = time.time_ns() - 60 * 10**9
        tag.publish_range(1, 12.34, t_ns=a_minute_ago_ns)
        tag.publish_imu((0.0, 0.0, 9.81), (0.0, 0.0, 0.1), t_ns=a_minute_ago_ns)
        tag.flush()
        wait_until(lambda: "hint" in service.ask("GET", "/api/v1/tags/long-ago/pose").json())
        pose = service.get("/api/v1/tags/long-ago/pose")
        assert (pose["state"], pose["age_s"] > 59) == ("initialising", True)


def test_the_command_on_the_page_names_the_site_and_the_anchor_of_the_service(tmp_path: Path) -> None:
    config = tmp_path / "yard.toml"
    config.write_text('[site]\nid = "west yard"\n[[site.anchors]]\nid = "gate 3"\n')
    with running_service("--config", str(config)) as service:
        shell(f"{service.get('/api/v1/connect')['simulate']} --duration 2", cwd=tmp_path)
        wait_until(lambda: tags(service).get("sim-1", {}).get("samples", {}).get("range", 0) > 5)


def test_an_anchor_that_the_site_lacks_is_reported_in_every_answer_and_once_in_the_log() -> None:
    with running_service() as service, TagClient("cart", connect=service.zenoh) as cart:
        cart.publish_range(1, 5.0)
        cart.flush()
        wait_until(lambda: service.get("/api/v1/site")["anchors"])

        def hint_after_a_range(tag: TagClient) -> str:
            """Publish a range to the missing anchor. Return the hint of the tag."""
            if tag is cart:
                tag.publish_heading(1.0)
            tag.publish_range(7, 4.0)
            tag.flush()
            return str(tags(service).get(tag.tag, {}).get("hint", ""))

        with TagClient("stray", connect=service.zenoh) as stray:
            wait_until(lambda: "No anchor that it hears is part of this site" in hint_after_a_range(stray))
            assert "anchor 7" in hint_after_a_range(stray)
            assert tags(service)["stray"]["unknown_anchor"] == "7"
            answer = service.ask("GET", "/api/v1/tags/stray/pose")
            assert answer.status_code == 404
            assert "anchor 7" in answer.json()["detail"]
        wait_until(lambda: "Hears anchor 7" in hint_after_a_range(cart))
        wait_until(
            lambda: (
                "anchor 7" in hint_after_a_range(cart) and "anchor 7" in service.get("/api/v1/tags/cart/pose")["hint"]
            )
        )
        listed = "/api/v1/poses?tags=cart"  # the hint changes when no range to a known anchor is recent any more
        wait_until(lambda: service.get(listed)["poses"][0]["hint"] == service.get("/api/v1/tags/cart/pose")["hint"])
        service.put("/api/v1/anchors/7", {"id": "7", "x": 3.0})
        wait_until(lambda: "anchor 7" not in hint_after_a_range(cart))
        lines = [line for line in service.log if "hears anchor 7, which this site does not have" in line]
        assert len(lines) == 1
        assert "PUT /api/v1/anchors/7" in lines[0]


def is_tracked_now(service: Running) -> bool:
    pose = service.ask("GET", "/api/v1/tags/cart/pose").json()
    return bool(pose.get("state") == "tracking" and abs(pose["age_s"]) < 5.0)


def stored(service: Running) -> list[str]:
    """Return the states in the stored track."""
    answer = service.ask("GET", "/api/v1/tags/cart/track")
    return [pose["state"] for pose in answer.json()["poses"]] if answer.is_success else []


def test_a_recording_replayed_at_ten_times_the_speed_is_tracked_and_ages_after_its_end(tmp_path: Path) -> None:
    recording = write_square(tmp_path)
    config = tmp_path / "service.toml"
    start = "{ x = 10, y = 0, heading_rad = 1.5708 }"
    config.write_text(f'[[site.anchors]]\nid = "A"\nx = 2\ny = -3\n[tags.cart]\nrange_std_m = 0.1\nstart = {start}\n')
    with running_service("--config", str(config), "--data-dir", str(tmp_path / "data")) as service:
        words = ["replay", str(recording), "--tag", "cart", "--anchor", "A", "--speed", "10"]
        replay = [sys.executable, "-m", "dropanchor_tag_client", *words, "--connect", service.zenoh]
        with subprocess.Popen(replay, stderr=subprocess.DEVNULL, env=environment()) as process:
            try:
                wait_until(lambda: is_tracked_now(service))
                assert process.wait(PATIENCE_S) == 0
            finally:
                process.kill()
        wait_until(lambda: len(stored(service)) > 40)  # one a second: the times are those of the recording
        placed = stored(service)[next(i for i, state in enumerate(stored(service)) if state == "tracking") :]
        assert set(placed) <= {"tracking", "ambiguous", "coasting"}  # ambiguous after a corner
        assert placed.count("tracking") > 0.7 * len(placed)
        wait_until(lambda: service.get("/api/v1/tags/cart/pose")["state"] in ("coasting", "lost"))


def test_the_page_of_a_secured_site_says_that_tags_need_credentials(tmp_path: Path) -> None:
    folder = tmp_path / "credentials of the yard"
    command = [sys.executable, "-m", "dropanchor_service"]
    subprocess.run(
        [*command, "security", "init", "--security", str(folder), "--host", "localhost"], check=True, env=environment()
    )
    subprocess.run([*command, "tag", "add", "sim-1", "--security", str(folder)], check=True, env=environment())
    key = subprocess.run(
        [*command, "key", "add", "page", "--scope", "read", "--security", str(folder)],
        check=True,
        env=environment(),
        capture_output=True,
        text=True,
    ).stdout.strip()
    with running_service(
        "--security", str(folder), "--zenoh-listen", f"tls/0.0.0.0:{free_port()}", ca=folder / "ca.pem"
    ) as service:
        assert service.ask("GET", "/api/v1/connect").status_code == 401
        bearer = {"authorization": f"Bearer {key}"}
        answer = service.ask("GET", "/api/v1/connect", headers=bearer).json()
        assert answer["credentials"]
        shell(f"{answer['simulate']} --duration 2", cwd=tmp_path)
        wait_until(
            lambda: json.loads(service.ask("GET", "/api/v1/tags/sim-1", headers=bearer).text).get("messages", 0) > 5
        )
