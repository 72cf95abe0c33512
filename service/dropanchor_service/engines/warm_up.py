"""Compile the kernels before they are needed."""

import numpy as np

from dropanchor_schemas.kinds import KINDS
from dropanchor_schemas.plans import Floor
from dropanchor_schemas.sentences import say
from dropanchor_schemas.site import Site
from dropanchor_schemas.wire import (
    ENCODING_PACKED,
    BearingSample,
    Frame,
    HeadingSample,
    ImuSample,
    RangeSample,
    encode_packed,
)
from dropanchor_schemas.zones import Circle, TooCloseRule, Zone
from dropanchor_service.answers.answers import Answers
from dropanchor_service.engines.compilation import CompilationProgress, compiling
from dropanchor_service.estimation.columns import (
    ANCHOR,
    HEADING,
    HYPOTHESIS,
    IMU,
    INNOVATION,
    POSE,
    RANGE,
    SampleBatch,
    State,
    default_settings,
)
from dropanchor_service.estimation.plausibility.check import SensorCheck
from dropanchor_service.estimation.protocols import Engine, FollowsAnchors
from dropanchor_service.ingest.decode import read_forms, read_samples
from dropanchor_service.ingest.kernels.anchors import HEARD, STEP, follow_anchors
from dropanchor_service.ingest.kernels.arrivals import record_arrivals
from dropanchor_service.ingest.kernels.starts import OPEN, follow_starts
from dropanchor_service.ingest.kernels.values import shift_times, time_spans
from dropanchor_service.ingest.messages import Messages
from dropanchor_service.ingest.publishers import Publishers
from dropanchor_service.ingest.screening import screen
from dropanchor_service.store import LatestPoses, SiteStore, TagTable
from dropanchor_service.store.arrivals import Arrivals
from dropanchor_service.store.floors import NO_FLOORS, floors_of
from dropanchor_service.store.groups import Groups
from dropanchor_service.zones.modes import placed
from dropanchor_service.zones.pair_watch import PairWatch, places_of
from dropanchor_service.zones.zone_watch import ZoneWatch

ESTIMATOR = say("the_estimator", "the estimator, which takes half a minute or more")
_DECODER = say("the_decoder", "the decoder of messages")
_ENCODER = say("the_encoder", "the encoder of answers")
_ZONES = say("the_zones", "the zones")


def warm_up(engine: Engine, progress: CompilationProgress | None = None) -> None:
    """Compile the kernels of `engine` with two seconds of a tag that moves off. Discard `engine` afterwards."""
    with compiling(ESTIMATOR, progress or CompilationProgress()):
        _run(engine)
        _judge_sensors()


def _judge_sensors() -> None:
    check = SensorCheck()
    for row in range(2):
        check.start(row)
    check.check(_moving_off(2))
    check.note_absurd(np.zeros(1, np.int32), np.zeros(1), np.zeros(1, np.int32))


def warm_up_belief() -> None:
    """Compile the belief of the engine `fleet` alone, with a measurement of no kind."""
    from dropanchor_service.estimation.fleet.belief.layout import BELIEF, MAX_HYPOTHESES, ROW
    from dropanchor_service.estimation.fleet.belief.pool import make_pool
    from dropanchor_service.estimation.fleet.belief.step import advance
    from dropanchor_service.estimation.fleet.belief.workspace import make_workspace
    from dropanchor_service.estimation.fleet.frontend.node import NODE
    from dropanchor_service.estimation.fleet.tuning import Tuning

    rows, nodes, beliefs = np.zeros(1, ROW), np.zeros(1, NODE), np.zeros(1, BELIEF)
    pool, anchors = make_pool(MAX_HYPOTHESES), np.zeros(0, ANCHOR)
    with compiling(ESTIMATOR, CompilationProgress()):
        advance(rows, pool, nodes, anchors, Tuning().record(), make_workspace(), beliefs)


def warm_up_front_end() -> None:
    """Compile all of the engine `fleet` but the belief, with a sample that makes no measurement of motion yet."""
    from dropanchor_service.estimation.fleet.engine import FleetEngine

    engine, samples = FleetEngine(), _moving_off(1)
    first = SampleBatch(imu=samples.imu[:1], ranges=samples.ranges[:0], headings=samples.headings[:0])
    with compiling("the front-end of the estimator", CompilationProgress()):
        engine.set_anchors(np.zeros(1, ANCHOR))
        engine.configure(0, default_settings())
        engine.process(first)
        _judge_sensors()


def _run(engine: Engine) -> None:
    engine.set_anchors(np.zeros(1, ANCHOR))
    unknown_start, known_start = default_settings(), default_settings()
    known_start["start_known"] = True
    known_start["start_x"], known_start["start_y"], known_start["start_heading"] = 10.0, 0.0, 0.0
    for row, settings in enumerate((unknown_start, known_start)):
        engine.configure(row, settings)
    engine.process(_moving_off(2))
    if isinstance(engine, FollowsAnchors):
        engine.move_anchors(np.ones(1, ANCHOR))


def _moving_off(rows: int) -> SampleBatch:
    """Return two seconds of samples of every kind for each row."""
    n = 200
    row = np.repeat(np.arange(rows), n)
    t_ns = np.tile(np.arange(n) * 10_000_000, rows)
    imu, ranges, headings = np.zeros(rows * n, IMU), np.zeros(rows * n // 10, RANGE), np.zeros(rows * n // 10, HEADING)
    imu["row"], imu["t_ns"], imu["acc"], imu["mag"] = row, t_ns, (0.3, 0.0, 9.81), (0.0, 20.0, -40.0)
    for columns in (ranges, headings):
        columns["row"], columns["t_ns"], columns["std"] = row[::10], t_ns[::10], np.nan
    ranges["range"] = 10.0 + 0.15 * (t_ns[::10] * 1e-9) ** 2
    return SampleBatch(imu=imu, ranges=ranges, headings=headings)


def warm_up_ingest(progress: CompilationProgress | None = None) -> None:
    """Compile the kernels of the ingest with two messages around a gap, and with one message.

    The columns of a single message have no strides, which makes them another type to the compiler.
    """
    frame = Frame(
        [ImuSample(1, (0.0, 0.0, 9.81), (0.0, 0.0, 0.0))],
        [RangeSample(1, 7, 1.0)],
        [HeadingSample(1, 0.0)],
        [BearingSample(1, 7, 0.0)],
        boot_id=1,
        boot_clock=True,
    )
    payloads = [encode_packed(frame.replaced(sequence=number)) for number in (0, 2)]
    with compiling(_DECODER, progress or CompilationProgress()):
        for batch in (payloads, payloads[:1]):
            _ingest(batch)


def _ingest(payloads: list[bytes]) -> None:
    read = read_forms(payloads, [ENCODING_PACKED] * len(payloads))
    publishers, n = Publishers(), len(payloads)
    of_turn = Messages(read, np.zeros(n, np.int32), np.zeros(n, np.int64), waited=n)
    sequenced = publishers.sequence(of_turn, 0)
    decoded, _ = screen(read_samples(read, sequenced.due))
    samples = [(decoded.imu["message"], decoded.imu["t_ns"]), (decoded.ranges["message"], decoded.ranges["t_ns"])]
    offsets = publishers.time_offsets(of_turn, sequenced, samples, 0)
    for messages, t_ns in samples:
        shift_times(t_ns, messages, offsets.messages)
        time_spans(t_ns, messages, np.zeros(n, np.int64), np.zeros(n, np.int64))
    arrivals, newest_of = Arrivals(), np.full((len(KINDS), n), -1, np.int64)
    record_arrivals(
        *(arrivals.columns, arrivals.are_conspicuous, read.forms, of_turn.rows, of_turn.arrived, sequenced.due),
        *(np.zeros(n, np.int64), newest_of, decoded.ranges),
    )
    follow_anchors(np.zeros(n, INNOVATION), np.zeros(n, HEARD), np.zeros(n, STEP))
    follow_starts(np.zeros(n, POSE), np.zeros(n, INNOVATION), np.zeros(n, OPEN), np.zeros(n, np.int64))


def warm_up_answers(progress: CompilationProgress | None = None) -> None:
    """Compile the kernels of the answers with an old pose and an ambiguous one."""
    answers = Answers(SiteStore(Site(), {}), TagTable(), LatestPoses())
    answers.site.floors = floors_of([Floor(name="a", bottom_m=0.0, top_m=1.0)])
    poses, hypotheses = np.zeros(2, POSE), np.zeros(2, HYPOTHESIS)
    for row in range(len(poses)):
        answers.tags.register(f"tag-{row}")
        poses["row"][row] = row
    poses["t_ns"] = [0, answers.now_ns()]
    poses["state"], hypotheses["row"] = State.AMBIGUOUS, 1
    answers.latest.write(poses, hypotheses)
    with compiling(_ENCODER, progress or CompilationProgress()):
        b"".join(answers.pose_list_json())


def warm_up_zones(progress: CompilationProgress | None = None) -> None:
    """Compile the kernels of zones and pairs with two tags at the same place."""
    poses, names = np.zeros(2, POSE), ["a", "b"]
    poses["row"], poses["t_ns"], poses["state"], poses["p_mode"] = (0, 1), 1, State.TRACKING, 1.0
    poses["cov"][:, :2, :2] = np.eye(2)
    with compiling(_ZONES, progress or CompilationProgress()):
        found = placed(poses, np.zeros(2), LatestPoses())
        zones = ZoneWatch()
        zones.set_zones([Zone(id="a", shape=Circle(type="circle", x=0.0, y=0.0, radius_m=9.0))], Groups())
        zones.add_tags(names)
        list(zones.judge(found))
        rule = TooCloseRule(id="a", type="too_close", distance_m=9.0, delay_s=0.0)
        pairs, places = PairWatch(rule, Groups()), places_of(*found.single(), NO_FLOORS)
        for _ in range(2):
            list(pairs.judge(poses["row"], places, names.__getitem__, 1))
