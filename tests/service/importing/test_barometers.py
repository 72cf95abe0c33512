"""Pressures of tables and of bags are found, and converted to Pa."""

from pathlib import Path

import pytest
from rosbags.rosbag2 import StoragePlugin
from rosbags.typesys import Stores

from service.importing import formats
from service.importing.command import Import

TIMES = [formats.T0_NS + i * 10_000_000 for i in range(20)]
PLAIN = "t,anchor,range\n0.0,A,5.5\n0.1,A,5.25\n0.2,A,5\n"


@pytest.mark.parametrize(
    ("column", "value"),
    [("pressure", 98_725), ("baro [hPa]", 987.25), ("pressure_mbar", 987.25), ("Air pressure (kPa)", 98.725)],
)
def test_a_column_of_pressures_is_found_and_converted(run: Import, column: str, value: float) -> None:
    ended = run(run.file("baro.csv", f"t,{column}\n0.0,{value}\n1.0,{value}\n"), run.file("uwb.csv", PLAIN))
    assert ended.status == 0, ended.error
    assert ended.column("pressure", "pressure_pa") == pytest.approx([98_725.0] * 2)


@pytest.mark.parametrize("store", [Stores.ROS1_NOETIC, Stores.ROS2_JAZZY])
def test_the_only_barometer_of_a_bag_is_taken_and_of_several_none(run: Import, store: Stores) -> None:
    ros = formats.Messages(store)

    def bag(name: str, *topics: str) -> Path:
        messages = [(t_ns, "/imu", ros.imu(t_ns, [0.0, 0.0, 9.8, 0.0, 0.0, 0.5])) for t_ns in TIMES]
        messages += [(t_ns, topic, ros.pressure(t_ns, 98_725.0)) for topic in topics for t_ns in TIMES[::10]]
        if ros.is_ros1:
            return formats.ros1_bag(run.folder / f"{name}.bag", messages, ros)
        return formats.ros2_bag(run.folder / name, messages, ros, StoragePlugin.MCAP)

    ended = run(bag("one", "/baro"))
    assert ended.status == 0, ended.error
    assert ended.column("pressure", "pressure_pa") == [98_725.0] * 2
    assert "pressures from /baro" in ended.printed
    several = run(bag("two", "/baro", "/other"), out="several")
    assert "not used: /baro, /other (several barometers)" in several.printed
    assert not (several.out / "pressure.csv").exists()
