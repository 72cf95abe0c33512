"""A program whose samples nobody receives says so, and does not end with 0."""

import logging
from collections.abc import Callable, Iterator
from io import BytesIO, TextIOWrapper
from pathlib import Path

import pytest

from dropanchor_schemas.keys import all_tags
from dropanchor_tag_client import SessionSettings, TagClient, Upkeep, read_credentials
from dropanchor_tag_client import upkeep as upkeep_module
from dropanchor_tag_client.cli import main
from dropanchor_tag_client.credentials import OtherTagError
from dropanchor_tag_client.session import SharedSession, open_session
from dropanchor_tag_client.sources.axes import mounting
from dropanchor_tag_client.sources.bridge.measurement import Drop, Measurement, Received
from dropanchor_tag_client.sources.bridge.pipe import Bridge
from dropanchor_tag_client.sources.modules.outlet import Azimuth, ManyTags
from dropanchor_tag_client.sources.modules.report import Range, Report
from dropanchor_tag_client.sources.modules.status_log import StatusLog
from support.patience import PATIENCE_S
from support.secured import SecuredSite, secured_site
from support.zenoh_router import make_known, wait_until

LINE = b'{"anchor": 1, "range_m": 3.5}\n'
ONES = "the credentials in .*one are of tag 'one' in site 'default'"
NOBODY = "nobody receives the samples of"


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[SecuredSite]:
    """Run a router that knows the tags `one` and `two`; a tag `late` gets its certificate afterwards."""
    made = secured_site(tmp_path_factory.mktemp("site") / "security", "one", "two")
    with made.router():
        made.folder.add_tag("late", days=30)
        yield made


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    folder = tmp_path / "two"
    folder.mkdir()
    (folder / "anchors.csv").write_text("id,x,y,z\n1,0,0,0\n")
    (folder / "range.csv").write_text("t_s,anchor_id,range_m\n0.0,1,1.5\n0.1,1,2.5\n")
    return folder


def run(monkeypatch: pytest.MonkeyPatch, recording: Path, words: list[str]) -> int:
    """Return the exit code of `dropanchor-tag`, with one line on its standard input."""
    monkeypatch.setattr("sys.stdin", TextIOWrapper(BytesIO(LINE)))
    return main([word.replace("RECORDING", str(recording)) for word in words])


FINITE = [["publish"], ["replay", "RECORDING", "--speed", "0"], ["simulate", "--duration", "0.2"]]


@pytest.mark.parametrize(
    "words",
    [
        ["publish", "--tag", "two"],
        ["publish", "--site", "other"],
        ["publish", "--tag", "two", "--spool", "spool"],
        ["replay", "RECORDING", "--tag", "two", "--speed", "0"],
        ["simulate"],
    ],
    ids=" ".join,
)
def test_a_program_with_the_credentials_of_another_tag_ends_before_it_sends(
    words: list[str],
    site: SecuredSite,
    recording: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    given = ["--credentials", str(site.folder.bundle("one"))]
    assert run(monkeypatch, recording, [*words, *given]) == 2
    captured = capsys.readouterr()
    assert "are of tag 'one' in site 'default'; the router would drop" in captured.err
    assert "samples sent" not in captured.err


@pytest.mark.parametrize("has_folder", [True, False], ids=["the folder", "single files"])
def test_a_client_in_python_refuses_the_certificate_of_another_tag(has_folder: bool, site: SecuredSite) -> None:
    folder = site.folder.bundle("one")
    cert, key = folder / "tag.pem", folder / "tag.key"
    of_files = SessionSettings(connect=site.endpoint, ca=folder / "ca.pem", cert=cert, key=key)
    session = read_credentials(folder).session if has_folder else of_files
    with pytest.raises(OtherTagError, match=ONES):
        TagClient("two", connect=session)


def through_a_module(options: dict[str, object]) -> str:
    log = StatusLog()
    outlet = ManyTags("", options, None, {}, mounting("x", "z"), log, Azimuth())
    outlet.publish(Report((Range("1", 3.5, tag="two"),)), 1_760_000_000_000_000_000)
    outlet.close()
    return "; ".join(log._pending)


def through_a_broker(options: dict[str, object]) -> str:
    bridge = Bridge([OneRange()], options, "", {})
    bridge.take(Received("any", b"", 1_760_000_000_000_000_000))
    bridge.close()
    assert bridge.summary() == "0 samples of 0 tags published; left out: other_tag 1"
    return bridge._last_detail[Drop.OTHER_TAG]


class OneRange:
    """A format of which every message holds a range of the tag `two`."""

    topics: tuple[str, ...] = ("any",)

    def parse(self, _message: Received) -> Iterator[Measurement]:
        yield Measurement("two", "range", {"anchor": 1, "range_m": 3.5})

    def overdue(self, _now_ns: int) -> tuple[()]:
        return ()


@pytest.mark.parametrize("source", [through_a_module, through_a_broker])
def test_a_gateway_leaves_out_tags_that_its_credentials_are_not_of_and_says_so(
    source: Callable[[dict[str, object]], str], site: SecuredSite
) -> None:
    settings = read_credentials(site.folder.bundle("one")).session
    session = open_session(settings, PATIENCE_S)
    try:
        said = source({"connect": SharedSession(session, settings), "batch_s": None})
    finally:
        session.close()
    assert "are of tag 'one' in site 'default'" in said


@pytest.mark.parametrize("words", FINITE, ids=lambda words: words[0])
def test_a_program_that_nobody_hears_says_so_and_fails(
    words: list[str],
    router_endpoint: str,
    recording: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    tag = [] if words[0] == "simulate" else ["--tag", "two"]
    assert run(monkeypatch, recording, [*words, *tag, "--connect", router_endpoint]) == 1
    assert NOBODY in capsys.readouterr().err


@pytest.mark.parametrize(("tag", "code"), [("two", 0), ("late", 1)])
def test_a_tag_that_the_router_does_not_know_yet_hears_of_the_restart_that_it_needs(
    tag: str,
    code: int,
    site: SecuredSite,
    recording: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    heard: list[object] = []
    with site.session("service") as service, service.declare_subscriber(all_tags("default", "samples"), heard.append):
        make_known(service)
        assert run(monkeypatch, recording, ["publish", "--credentials", str(site.folder.bundle(tag))]) == code
    said = capsys.readouterr().err
    assert (f"{NOBODY} {tag}: does the service run, and was the router restarted" in said) == (code == 1)
    assert bool(heard) == (code == 0)


def test_a_program_that_runs_on_warns_while_nobody_receives_its_samples(
    router_endpoint: str, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(upkeep_module, "_UNHEARD_S", 0.0)
    with caplog.at_level(logging.WARNING), TagClient("a", connect=router_endpoint) as tag, Upkeep([tag], period_s=0.05):
        wait_until(lambda: f"{NOBODY} a: does the service run" in caplog.text)
