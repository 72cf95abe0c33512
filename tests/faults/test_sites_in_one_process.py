"""Sites that share a process change no bit of each other, whatever one of them does."""

from collections.abc import Callable, Iterable, Mapping
from copy import deepcopy
from typing import NamedTuple

import numpy as np

from dropanchor_schemas.site import Anchor, Site, TagSettings
from dropanchor_schemas.wire import Frame, RangeSample, encode_packed
from dropanchor_service.estimation.columns import POSE, Array
from dropanchor_service.estimation.fleet.engine import FleetEngine
from dropanchor_service.ingest.observers import Observers
from dropanchor_service.settings.quota import Quota
from dropanchor_service.store import Sites, SiteStore
from support.ingest import IngestBench
from support.manual_clock import ManualClock
from support.traffic import T0_NS, known_starts, traffic

TAGS, SECONDS = 3, 18.0
S = 1_000_000_000
_FIELDS = [name for name in POSE.names or () if name != "row"]

NORTH = Site(id="north", anchors=[Anchor(id="1")])
SOUTH = Site(id="south", declination_rad=0.3, anchors=[Anchor(id="9", x=3.0), Anchor(id="1", x=40.0, y=-25.0, z=1.0)])
"""Both have an anchor 1, at different places, which has another index in each. Both get tags of the same names."""

Change = Callable[["Run"], None]


class Message(NamedTuple):
    due_ns: int
    site: str
    tag: str
    payload: bytes


def of_site(site: str, seed: int, seconds: float = SECONDS) -> list[Message]:
    return [Message(m.due_ns, site, m.tag, m.payload) for m in traffic(TAGS, seconds, seed)]


def starts(seed: int) -> dict[str, TagSettings]:
    return {tag: TagSettings.model_validate(settings) for tag, settings in known_starts(TAGS, seed).items()}


def north() -> tuple[SiteStore, Quota]:
    return SiteStore(NORTH, starts(1)), Quota()


def south() -> tuple[SiteStore, Quota]:
    """One tag of the south starts at a known place, the others look for theirs."""
    return SiteStore(SOUTH, dict(list(starts(2).items())[:1])), Quota()


class Run:
    """The ingest of some sites with the engine fleet. poses: of each (site, tag), in the order in which they came."""

    def __init__(self, *sites: tuple[SiteStore, Quota]) -> None:
        self.clock = ManualClock()
        self.batches: list[Array] = []
        self.bench = IngestBench(
            engine=FleetEngine(),
            clock=self.clock,
            sites=Sites(sites),
            observers=Observers(poses=lambda poses: self.batches.append(poses.copy())),
        )

    def feed(self, messages: Iterable[Message], changes: Mapping[int, Change] | None = None) -> "Run":
        """Fuse all messages, with one turn for those that are due together. changes: made before a time, in ns."""
        left = dict(changes or {})
        for message in sorted(messages, key=lambda message: message.due_ns):
            if message.due_ns != self.clock.t_ns:
                self.bench.ingest.turn()
                self.clock.t_ns = message.due_ns
                for t_ns in [t_ns for t_ns in left if t_ns <= message.due_ns]:
                    left.pop(t_ns)(self)
            self.bench.put(message.tag, message.payload, at_ns=message.due_ns, site=message.site)
        self.bench.ingest.turn()
        return self

    def poses(self, site: str) -> dict[str, bytes]:
        """Return the bits of the poses of each tag of a site, without their rows."""
        found = np.concatenate(self.batches)
        of = self.bench.sites.find(site)
        assert of is not None
        bits = {tag.name: found[found["row"] == tag.row] for tag in of.tags.all()}
        assert min(len(poses) for poses in bits.values()) > 50
        return {name: b"".join(poses[field].tobytes() for field in _FIELDS) for name, poses in bits.items()}


def test_the_same_samples_give_the_same_bits_alone_and_beside_a_site_with_equal_names() -> None:
    north_alone, south_alone = Run(north()).feed(of_site("north", 1)), Run(south()).feed(of_site("south", 2))
    for sites in ((north(), south()), (south(), north())):
        together = Run(*sites).feed([*of_site("north", 1), *of_site("south", 2)])
        assert together.poses("north") == north_alone.poses("north")
        assert together.poses("south") == south_alone.poses("south")
    assert north_alone.poses("north").keys() == south_alone.poses("south").keys()
    assert north_alone.poses("north") != south_alone.poses("south")


def move_anchor(run: Run) -> None:
    run.bench.sites[1].store.set_anchor(Anchor(id="1", x=-7.0))


def change_site(run: Run) -> None:
    run.bench.sites[1].store.set_site(SOUTH.model_copy(update={"declination_rad": 0.1, "anchors": []}))


def garbage() -> list[Message]:
    """Return cut messages of a known tag, ranges to unknown anchors, and 400 tags that nobody knows, each second."""
    found = []
    for second in range(int(SECONDS)):
        t_ns = T0_NS + second * S
        payload = encode_packed(Frame(ranges=[RangeSample(t_ns, 77, 5.0), RangeSample(t_ns, 1, -5.0)]))
        found.append(Message(t_ns, "south", "sim-1", b"\x01cut"))
        found += [Message(t_ns, "south", f"{second}-{number}", payload) for number in range(400 // int(SECONDS))]
        found.append(Message(t_ns, "elsewhere", "sim-1", payload))
    return found


def test_a_site_with_garbage_strangers_and_moved_anchors_changes_no_bit_of_another() -> None:
    alone = Run(north()).feed(of_site("north", 1))
    quota = Quota(max_tags=TAGS + 20, max_unconfirmed_tags=5)
    run = Run(north(), (south()[0], quota))
    run.feed(
        [*of_site("north", 1), *of_site("south", 2), *garbage()],
        {T0_NS + 6 * S: move_anchor, T0_NS + 12 * S: change_site},
    )
    assert run.poses("north") == alone.poses("north")
    rejected = run.bench.rejected()
    assert {"anchor_unknown", "range_negative", "header_truncated", "key_invalid"} <= set(rejected)
    assert len(run.bench.sites[1].tags) <= quota.max_tags
    assert len(run.bench.sites[0].tags) == TAGS


def test_after_a_restart_the_bits_go_on_and_only_a_site_whose_anchor_has_moved_starts_afresh() -> None:
    messages = [*of_site("north", 1), *of_site("south", 2)]
    middle_ns = T0_NS + 9 * S
    first, second = [m for m in messages if m.due_ns < middle_ns], [m for m in messages if m.due_ns >= middle_ns]
    before = Run(north(), south()).feed(first)
    snapshot = before.bench.service_state().snapshot()
    after, moved = Run(south(), (SiteStore(Site(id="west"), {}), Quota()), north()), Run(north(), south())
    move_anchor(moved)
    for run in (after, moved):
        run.bench.service_state().restore(deepcopy(snapshot))
        run.feed(second)
    before.batches.clear()
    before.feed(second)
    assert after.poses("north") == before.poses("north")
    assert after.poses("south") == before.poses("south")
    assert moved.poses("north") == before.poses("north")
    assert moved.poses("south") != before.poses("south")


def test_a_site_that_leaves_changes_no_bit_of_another_and_goes_on_where_it_was_when_it_comes_back() -> None:
    messages = [*of_site("north", 1), *of_site("south", 2)]
    middle_ns = T0_NS + 9 * S
    first, second = [m for m in messages if m.due_ns < middle_ns], [m for m in messages if m.due_ns >= middle_ns]
    before = Run(north(), south()).feed(first)
    snapshot = before.bench.service_state().snapshot()
    before.batches.clear()
    before.feed(second)
    for others in ([], [(SiteStore(Site(id="west"), {}), Quota())]):
        left = Run(north(), *others)
        left.bench.service_state().restore(deepcopy(snapshot))
        back = Run(south(), north())
        back.bench.service_state().restore(deepcopy(left.bench.service_state().snapshot()))
        left.feed([message for message in second if message.site == "north"])
        back.feed(second)
        assert left.poses("north") == back.poses("north") == before.poses("north")
        assert back.poses("south") == before.poses("south")
