"""A recording published over a real router: the same samples, in order, with their spacing."""

import math
import time
from pathlib import Path

import pytest

from dropanchor_schemas.wire import Frame, anchor_number
from dropanchor_tag_client.cli import main
from support.listening import ReceivedFrames, listening, listening_with_recovery
from support.zenoh_router import wait_until

T0 = 1_760_000_000_000_000_000
ANCHORS = "id,x,y,z\nL0,1,2,0.5\n7,0,0,0\n"
RANGES = "t_s,anchor_id,range_m,std_m\n10.0,L0,1.5,0.25\n10.2,7,2.5,\n10.4,L0,1.75,0.5\n"
IMU = "t_s,ax,ay,az,gx,gy,gz,mx,my,mz\n10.1,0.5,0.25,9.75,0,0,1,1,2,3\n10.3,0,0,9,0,0,0.5,,,\n"
HEADINGS = "t_s,yaw_rad\n10.25,1.5\n"
PRESSURES = "t_s,pressure_pa,temperature_c\n10.15,101325,21.5\n10.35,101300,\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    yard = tmp_path / "yard"
    yard.mkdir()
    for name, text in {
        "anchors": ANCHORS,
        "range": RANGES,
        "imu": IMU,
        "heading": HEADINGS,
        "pressure": PRESSURES,
    }.items():
        (yard / f"{name}.csv").write_text(text)
    return yard


def times(frames: list[Frame]) -> list[int]:
    return sorted(t_ns for frame in frames for t_ns in frame.times())


def samples(heard: ReceivedFrames) -> int:
    return sum(len(frame) for frame in heard.frames)


def test_every_sample_keeps_its_values_and_its_time(router_endpoint: str, folder: Path) -> None:
    with listening(router_endpoint) as heard:
        assert main(["replay", str(folder), "--connect", router_endpoint, "--speed", "0", "--t0-ns", str(T0)]) == 0
        wait_until(lambda: samples(heard) == 8)
    (frame,) = heard.frames
    assert heard.keys == ["dropanchor/@v1/default/tag/yard/samples"]
    second = 1_000_000_000
    assert [(s.t_ns, s.anchor, s.range_m) for s in frame.ranges] == [
        (T0 + 10 * second, anchor_number("L0"), 1.5),
        (T0 + 10 * second + 200_000_000, 7, 2.5),
        (T0 + 10 * second + 400_000_000, anchor_number("L0"), 1.75),
    ]
    assert [s.std_m for s in frame.ranges if not math.isnan(s.std_m)] == [0.25, 0.5]
    assert frame.imu[0] == (T0 + 10 * second + 100_000_000, (0.5, 0.25, 9.75), (0.0, 0.0, 1.0), (1.0, 2.0, 3.0))
    assert frame.imu[1].mag is None
    assert frame.headings[0][:2] == (T0 + 10 * second + 250_000_000, 1.5)
    assert frame.pressures[0] == (T0 + 10 * second + 150_000_000, 101_325.0, 21.5)
    assert frame.pressures[1][:2] == (T0 + 10 * second + 350_000_000, 101_300.0)


def test_one_anchor_alone_may_be_replayed_under_another_name(router_endpoint: str, folder: Path) -> None:
    options = ["--anchor", "7", "--speed", "0", "--tag", "cart", "--site", "west", "--encoding", "json"]
    with listening(router_endpoint, site="west") as heard:
        assert main(["replay", str(folder), "--connect", router_endpoint, *options]) == 0
        wait_until(lambda: samples(heard) == 6)
    assert heard.keys == ["dropanchor/@v1/west/tag/cart/samples"]
    assert heard.ranges() == [2.5]


@pytest.mark.parametrize(("speed", "length_s"), [("1", 0.4), ("2", 0.2), ("0", 0.0)])
def test_a_replay_takes_the_time_of_its_speed_and_ends_at_the_present(
    router_endpoint: str, folder: Path, speed: str, length_s: float
) -> None:
    with listening(router_endpoint) as heard:
        began, began_ns = time.monotonic(), time.time_ns()
        assert main(["replay", str(folder), "--connect", router_endpoint, "--speed", speed]) == 0
        took, ended_ns = time.monotonic() - began, time.time_ns()
        wait_until(lambda: samples(heard) == 8)
    assert length_s <= took < length_s + 15.0
    assert times(heard.frames)[-1] - times(heard.frames)[0] == pytest.approx(400_000_000, abs=2000)
    assert began_ns + length_s * 1e9 - 1e8 <= times(heard.frames)[-1] <= ended_ns


def test_as_fast_as_possible_still_loses_nothing(router_endpoint: str, tmp_path: Path) -> None:
    lines = "".join(f"{i / 100},7,{i % 50}\n" for i in range(20_000))
    (tmp_path / "anchors.csv").write_text(ANCHORS)
    (tmp_path / "range.csv").write_text("t_s,anchor_id,range_m\n" + lines)
    with listening_with_recovery(router_endpoint) as heard:
        assert main(["replay", str(tmp_path), "--connect", router_endpoint, "--speed", "0"]) == 0
        wait_until(lambda: samples(heard) >= 20_000)
    assert heard.ranges() == [float(i % 50) for i in range(20_000)]
