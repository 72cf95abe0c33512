"""What to say about a topic of which no message comes: what is published instead."""

from collections.abc import Callable, Iterable, Mapping

from dropanchor_service.bridges.rmw_zenoh import Announced
from dropanchor_service.bridges.ros2dds import RosKeys

SILENT_S = 5.0
_MAX_TOPICS = 20


class SilenceWatch:
    """Say once that a topic is silent, again when what is published has changed, and once that its messages come.

    wanted: by topic, the name of its type. router: of the ROS nodes. published: returns the publishers of other nodes.
    Times are monotonic, in s.
    """

    def __init__(
        self,
        wanted: Mapping[str, str],
        keys: RosKeys,
        router: str,
        published: Callable[[], list[Announced]],
        now_s: float,
    ) -> None:
        self._wanted = wanted
        self._keys = keys
        self._router = router
        self._published = published
        self._heard_s = dict.fromkeys(wanted, now_s)
        self._told = dict.fromkeys(wanted, "")
        self._next_s = now_s + SILENT_S

    def heard(self, topic: str, now_s: float) -> str:
        """Note a message. Return what to say."""
        self._heard_s[topic] = now_s
        was_silent, self._told[topic] = bool(self._told[topic]), ""
        return f"messages of {topic} come" if was_silent else ""

    def sentences(self, now_s: float) -> list[str]:
        """Return what to say about topics that have been silent for a while."""
        if now_s < self._next_s:
            return []
        self._next_s = now_s + SILENT_S
        news = []
        for topic, type_name in self._wanted.items():
            if now_s - self._heard_s[topic] >= SILENT_S:
                sentence = self._sentence(topic, type_name)
                news += [sentence] if sentence != self._told[topic] else []
                self._told[topic] = sentence
        return news

    def _sentence(self, topic: str, type_name: str) -> str:
        everywhere = self._published()
        here = [one for one in everywhere if one.domain == self._keys.here]
        silent = f"no message of {topic} comes"
        if not here:
            return f"{silent}: {self._nobody({one.domain for one in everywhere})}"
        same = [one for one in here if one.topic.strip("/") == topic.strip("/")]
        if any(one.type_name == type_name for one in same):
            nodes = ", ".join(sorted({one.node for one in same}))
            return f"{silent}, although the node {nodes} publishes it: does its sensor give anything?"
        if same:
            types = ", ".join(sorted({one.type_name for one in same}))
            return f"{silent}: it is published as {types}, and {type_name} is needed"
        return f"{silent}: no node publishes it. These are published: {_listed(here, type_name)}"

    def _nobody(self, domains: Iterable[str]) -> str:
        others = ", ".join(sorted(domains))
        if others:
            return (
                f"no node publishes anything in domain {self._keys.here}, but in domain {others}: --domain says which"
            )
        return f"no node that publishes is connected to the router {self._router}. {self._keys.advice}"


def _listed(published: Iterable[Announced], type_name: str) -> str:
    """Return topics and their types, those of the wanted type first."""
    topics = sorted({(one.type_name != type_name, one.topic, one.type_name) for one in published})
    shown = [f"{topic} ({name})" for _, topic, name in topics[:_MAX_TOPICS]]
    more = len(topics) - len(shown)
    return ", ".join(shown) + (f" and {more} more" if more else "")
