"""What is said about silent topics of a robot."""

from dropanchor_service.bridges.rmw_zenoh import Announced, RmwZenoh
from dropanchor_service.commands.ros_silence import SILENT_S, SilenceWatch

IMU = "sensor_msgs/msg/Imu"


def publisher(topic: str, type_name: str = "std_msgs/msg/String") -> Announced:
    return Announced("0", "8b20", "driver", topic, type_name)


def test_a_topic_is_told_once_until_what_is_published_changes_or_it_comes() -> None:
    published = [publisher("/log")]
    watch = SilenceWatch({"/imu": IMU}, RmwZenoh(0), "tcp/127.0.0.1:7447", lambda: published, 0.0)
    assert watch.sentences(SILENT_S - 0.1) == []
    (told,) = watch.sentences(SILENT_S)
    assert told.endswith("no node publishes it. These are published: /log (std_msgs/msg/String)")
    assert watch.sentences(3 * SILENT_S) == []
    published.append(publisher("/imu", IMU))
    assert len(watch.sentences(5 * SILENT_S)) == 1
    assert watch.heard("/imu", 5.5 * SILENT_S) == "messages of /imu come"
    assert watch.heard("/imu", 5.6 * SILENT_S) == ""
    assert watch.sentences(6.5 * SILENT_S) == []
    assert len(watch.sentences(8 * SILENT_S)) == 1


def test_of_many_topics_those_of_the_wanted_type_come_first_and_the_rest_is_counted() -> None:
    published = [*(publisher(f"/a{number}") for number in range(30)), publisher("/z", IMU)]
    watch = SilenceWatch({"/imu": IMU}, RmwZenoh(0), "tcp/127.0.0.1:7447", lambda: published, 0.0)
    (told,) = watch.sentences(SILENT_S)
    assert "These are published: /z (sensor_msgs/msg/Imu), /a0 (" in told
    assert told.endswith(" and 11 more")


def test_a_domain_in_which_nobody_publishes_is_told_with_the_others() -> None:
    watch = SilenceWatch({"/imu": IMU}, RmwZenoh(5), "tcp/127.0.0.1:7447", lambda: [publisher("/imu", IMU)], 0.0)
    (told,) = watch.sentences(SILENT_S)
    assert told.endswith("no node publishes anything in domain 5, but in domain 0: --domain says which")


def test_without_any_node_it_is_told_how_nodes_reach_the_router() -> None:
    (told,) = SilenceWatch({"/imu": IMU}, RmwZenoh(0), "tcp/127.0.0.1:7447", list, 0.0).sentences(SILENT_S)
    assert "no node that publishes is connected to the router tcp/127.0.0.1:7447" in told
    assert "RMW_IMPLEMENTATION=rmw_zenoh_cpp" in told
