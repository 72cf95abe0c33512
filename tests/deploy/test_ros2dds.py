"""The configuration of zenoh-bridge-ros2dds and the launch file beside it fit the program."""

import argparse
import json
import re
from xml.etree import ElementTree

import zenoh

from dropanchor_service.commands import ros2
from support.service import ROOT

FOLDER = ROOT / "deploy" / "ros2dds"


def test_the_launched_program_reads_and_publishes_what_the_bridge_lets_through_where_it_listens() -> None:
    launch = ElementTree.parse(FOLDER / "dropanchor.launch.xml").getroot()
    bridge, program = (each.get("cmd", "") for each in launch.iter("executable"))
    for argument in launch.iter("arg"):
        name = argument.get("name", "")
        program = program.replace(f"$(var {name})", argument.get("default", name))
    parser = argparse.ArgumentParser(prog="dropanchor ros2")
    ros2.add_arguments(parser)
    parsed = parser.parse_args(program.removeprefix("dropanchor ros2").split())

    assert bridge.endswith("/bridge.json5")
    config = zenoh.Config.from_file(FOLDER / "bridge.json5")
    assert json.loads(config.get_json("listen/endpoints")) == [parsed.ros_connect]
    allowed = json.loads(config.get_json("plugins"))["ros2dds"]["allow"]
    topics = {
        "publishers": [parsed.imu, *(topic for topic, _ in parsed.range)],
        "subscribers": [f"/{parsed.namespace}/pose", f"/{parsed.namespace}/odometry", "/tf"],
    }
    for kind, names in topics.items():
        assert all(any(re.fullmatch(one, name) for one in allowed[kind]) for name in names), kind
