"""Follow the tutorial, send the requests of the guides, and make the credentials in them, all as written there.

What is not run stands in a list, with the reason. `tests/service/test_samples_in_guides.py` checks all of it.
"""

import re
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from support.guides import ADDRESS, run
from support.samples import Sample, commands, samples
from support.service import ROOT, Running, running_service
from support.yard import running_yard

ADDRESSES = (ADDRESS, ADDRESS.replace("127.0.0.1", "localhost"))
CURL = """curl() {
  case " $* " in
    *" -N "*) command curl --fail-with-body --max-time 3 "$@" || [ $? = 28 ] ;;
    *) command curl --fail-with-body "$@" ;;
  esac
}
"""
"""An error of the service ends a script. A stream has no end: that of its time is none."""

BY_OTHERS = {
    "README.md": "tests/e2e/test_first_ten_minutes.py",
    "back-up.md": "tests/e2e/test_backup.py",
    "generate-a-client.md": "tests/e2e/test_generated_clients.py",
    "read-exports.md": "tests/e2e/test_read_exports.py",
    "send-poses-elsewhere.md": "tests/e2e/test_send_poses_elsewhere.py",
    "put-it-behind-a-proxy.md": "tests/e2e/test_behind_a_proxy.py",
}
"""Pages whose samples another test runs."""
CREDENTIALS = ("connect-a-phone.md", "secure-a-site.md", "serve-several-sites.md")
"""Pages of which the lines are run that make credentials."""
_STAYS, _FILES, _PIP = "runs until it is stopped", "needs files of the reader", "installs a package"
_PAST = "asks for a time at which a black box was there: tests/e2e/test_past.py"
NOT_RUN = {
    "a-tag-is-wrong.md: dropanchor doctor": "needs the port 8080: tests/service/commands/test_doctor.py",
    "a-tag-is-wrong.md: curl -s 'http://127.0.0.1:8080/api/v1/tags/forklift-7/samples?from=2026-01-30T14:58:00Z"
    "&to=2026-01-30T15:00:00Z&anonymous=true' > minutes.mcap": _PAST,
    "explain-a-pose.md: curl -s 'http://127.0.0.1:8080/api/v1/tags/forklift-7/explain?at=2026-01-30T15:00:00Z'": _PAST,
    "explain-a-pose.md: curl -s http://127.0.0.1:8080/api/v1/tags/forklift-7/what-if "
    "-H 'content-type: application/json' \\": _PAST,
    "tutorial.md: make demo": f"{_STAYS}: tests/e2e/test_demo.py",
    "tutorial.md: .venv/bin/dropanchor serve --data-dir data": f"{_STAYS}: tests/e2e/test_start_and_stop.py",
    "change-the-code.md: .venv/bin/python -m dropanchor_schemas.export": "writes into the repository",
    "connect-a-phone.md: dropanchor serve --security security --host 0.0.0.0": "listens beyond the loopback",
    "connect-a-phone.md: READER=$(dropanchor key add reader)": "asks a secured service: tests/e2e/test_phone.py",
    'connect-a-phone.md: curl --cacert security/ca.pem -H "Authorization: Bearer $KEY" '
    '-H "Content-Type: application/json" \\': "asks a secured service: tests/e2e/test_phone.py",
    "connect-a-robot.md: pip install 'dropanchor-service[ros2]'": _PIP,
    "connect-a-robot.md: dropanchor serve --zenoh-listen tcp/127.0.0.1:7448": "needs ROS 2: tests/e2e/test_ros2.py",
    "connect-a-robot.md: export ROS_DISTRO=jazzy ROS_DOMAIN_ID=0": "needs ROS 2 and a bridge: tests/e2e/test_ros2.py",
    "import-data.md: dropanchor import drive.mcap --out recordings/drive": f"{_FILES}: tests/service/importing",
    "import-data.md: dropanchor import log.csv --out recordings/drive \\": f"{_FILES}: tests/service/importing",
    "import-data.md: dropanchor import drive.bag --imu /imu/data --range /uwb/gate=1 "
    "--range /uwb/hall=2 \\": f"{_FILES}: tests/service/importing",
    "keep-a-history.md: sudo -u postgres createuser --pwprompt dropanchor": "changes a database of the machine",
    "keep-a-history.md: dropanchor history move --from /var/lib/dropanchor/history.sqlite "
    "--password-file /etc/dropanchor/database-password \\": "needs a database: tests/service/history",
    "measure-azimuth.md: dropanchor-tag serial /dev/ttyUSB0 --module pdoa --tag-from-id --as-anchor yard "
    "--azimuth-std 10 --connect tcp/127.0.0.1:7447": "needs a module: tests/e2e/test_measured_azimuth.py",
    "measure-accuracy.md: pip install 'dropanchor-service[evaluation]'": _PIP,
    "measure-accuracy.md: dropanchor evaluate product --quick": "takes hours: tests/evaluation",
    "measure-accuracy.md: dropanchor evaluate bounds --rows 'S5/*' --seeds 5000-5019": "takes hours",
    "put-api-nodes-before-a-cluster.md: head -c 32 /dev/urandom | base64 > /etc/dropanchor/node.secret": "writes /etc",
    "put-api-nodes-before-a-cluster.md: dropanchor api --config yards.toml --host 0.0.0.0 "
    "--security /etc/dropanchor/security": f"{_STAYS}: tests/e2e/test_api_nodes.py",
    "react-to-events.md: curl -X PUT http://127.0.0.1:8080/api/v1/destinations/shift "
    "-H 'Content-Type: application/json' -d '{": "needs a mail server: tests/service/delivery",
    "install-a-release.md: docker build -f deploy/Dockerfile -t dropanchor .": "tests/deploy/test_dockerfile.py",
    'install-a-release.md: pipx install --force --pip-args="--constraint $PWD/constraints.txt --find-links $PWD" '
    "'dropanchor-service[maps]'": "tests/deploy/test_release.py",
    "install-a-release.md: python3 -m venv ~/dropanchor": "tests/deploy/test_release.py",
    "install-a-release.md: sha256sum --check SHA256SUMS": "tests/deploy/test_release.py",
    "react-to-events.md: curl http://127.0.0.1:8080/api/v1/alarms": (
        "needs an alarm: tests/service/api/routes/test_zones_and_events.py"
    ),
    "react-to-events.md: echo whsec_$(openssl rand -base64 32)": "the secret is left to the reader",
    "record-and-replay.md: dropanchor record start": "needs the port 8080: tests/e2e/test_recording.py",
    "record-and-replay.md: dropanchor replay FOLDER_OR_FILE": f"{_FILES}: tests/e2e/test_replay_live_and_offline.py",
    "run-a-cluster.md: pip install 'dropanchor-service[cluster]'": _PIP,
    "run-a-cluster.md: dropanchor cluster start --head --config yards.toml": "tests/e2e/test_cluster_on_ray.py",
    "run-a-cluster.md: dropanchor cluster drain machine-1 --config yards.toml": "tests/e2e/test_cluster_on_ray.py",
    "run-a-cluster.md: pip install --upgrade 'dropanchor-service[cluster]'": _PIP,
    "run-a-cluster.md: pip install 'dropanchor-service[cluster,s3]'": _PIP,
    'secure-a-site.md: curl --cacert security/ca.pem -H "Authorization: Bearer $KEY" '
    "'https://localhost:8080/api/v1/audit?kind=anchor,tag&from=2027-01-15T08:00:00Z'": (
        "asks a secured service: tests/service/api/routes/test_audit.py"
    ),
    'secure-a-site.md: curl --cacert security/ca.pem -H "Authorization: Bearer $KEY" '
    "-H 'Content-Type: application/json' \\": "asks a secured service: tests/service/api/routes/test_shares.py",
    "smooth-a-track.md: dropanchor replay RECORDING --smooth": f"{_FILES}: tests/e2e/test_replay_live_and_offline.py",
    "take-over-when-a-machine-dies.md: pip install 'dropanchor-service[postgresql]'": _PIP,
    "take-over-when-a-machine-dies.md: from dropanchor_schemas.epochs import EpochFence": "is a part of a program",
    "use-an-omlox-client.md: import asyncio, json, websockets": f"{_STAYS}: tests/e2e/test_omlox.py",
    "watch-in-foxglove.md: pip install 'dropanchor-service[foxglove]'": _PIP,
}
"""Samples that are not run, and why; with the test that does it otherwise."""


def only_asks(sample: Sample) -> bool:
    """Return whether a script does nothing but send requests to the service on this machine."""
    found = [words for words in commands(sample.text) if words]
    return all(one[0] == "curl" and any(word.startswith(ADDRESSES) for word in one) for one in found)


def made_in(page: str) -> list[str]:
    """Return the lines of a page that make credentials, if it is one of those that begin without any."""
    if page not in CREDENTIALS:
        return []
    texts = [sample.text for sample in samples("sh") if sample.page == page]
    return [line for text in texts for line in text.splitlines() if re.match("dropanchor (security|tag|key) ", line)]


def of(sample: Sample, service: Running) -> str:
    """Return the text of a sample with the addresses of a service in place of the usual ones."""
    text = sample.text.replace("tcp/127.0.0.1:7447", service.zenoh)
    for address in ADDRESSES:
        text = text.replace(address, service.url)
    client = f"{sys.executable} -m dropanchor_tag_client publish --connect {service.zenoh}"
    return text.replace(".venv/bin/dropanchor-tag publish", client)


ALL = [sample for sample in samples("sh", "python") if sample.page not in BY_OTHERS]
FOLLOWED = [sample for sample in ALL if sample.page == "tutorial.md" and sample.name not in NOT_RUN]
ASKING = [
    sample
    for sample in ALL
    if sample.language == "sh" and only_asks(sample) and sample not in FOLLOWED and sample.name not in NOT_RUN
]


@pytest.fixture(scope="module")
def yard(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Running]:
    with running_yard(tmp_path_factory.mktemp("yard"), "forklift-7") as running:
        yield running


def test_every_sample_is_run_or_listed_with_the_reason() -> None:
    made = {
        sample.name
        for sample in ALL
        if sample.page in CREDENTIALS and sample.text.splitlines()[0] in made_in(sample.page)
    }
    done = {sample.name for sample in (*FOLLOWED, *ASKING)} - NOT_RUN.keys()
    assert {sample.name for sample in ALL} - done - made == NOT_RUN.keys()
    for reason in (*BY_OTHERS.values(), *NOT_RUN.values()):
        for path in re.findall(r"tests/\S+", reason):
            assert (ROOT / path).exists(), path


def test_the_tutorial_is_followed(tmp_path: Path) -> None:
    with running_service("--data-dir", str(tmp_path / "data")) as service:
        for sample in FOLLOWED:
            program = of(sample, service)
            if sample.language == "python":
                (tmp_path / "tag.py").write_text(program)
                run(f"{sys.executable} tag.py", tmp_path)
            else:
                run(CURL + program, tmp_path)
        start = service.get("/api/v1/tags/forklift-7")["settings"]["start"]
        assert (start["x"], start["y"]) == (10.0, 0.0)


@pytest.mark.parametrize("sample", ASKING, ids=lambda sample: sample.name)
def test_the_service_answers_the_requests_of_a_guide(sample: Sample, yard: Running, tmp_path: Path) -> None:
    run(CURL + of(sample, yard), tmp_path)


@pytest.mark.parametrize("page", CREDENTIALS)
def test_the_credentials_of_a_guide_are_made(page: str, tmp_path: Path) -> None:
    lines = made_in(page)
    assert len(lines) >= 3
    run("\n".join(lines), tmp_path)
    assert (tmp_path / "security" / "ca.pem").exists()
