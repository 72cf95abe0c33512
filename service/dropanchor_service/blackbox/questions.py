"""The questions that a run answers, and its answers."""

import math
from pathlib import Path
from typing import Any

from dropanchor_schemas.models import Exact
from dropanchor_schemas.past import WhatIf
from dropanchor_schemas.sentences import say
from dropanchor_schemas.site import Site, StartPose, TagSettings
from dropanchor_service.answers.explain import MINUTE_NS, explanation_of
from dropanchor_service.blackbox.causes import causes_of
from dropanchor_service.blackbox.chosen import BoxError
from dropanchor_service.blackbox.rerun import Rerun, is_sure
from dropanchor_service.recording.reading import Turn

AFTER_NS = 10_000_000_000
UNSURE_S = 1.0  # for which a tag may have been mounted in another way than a what-if says


class Question(Exact):
    """What a run is to answer. at_ns and last: explain the pose of that time. what_if: run with other settings."""

    folder: Path
    site: str
    tag: str
    at_ns: int = 0
    last: int = 50
    what_if: WhatIf | None = None


def answer_to(question: Question) -> dict[str, Any]:
    """Return the `Explanation` or the `WhatIfAnswer`. Raises BoxError."""
    return _explained(question) if question.what_if is None else _compared(question, question.what_if)


def _explained(question: Question) -> dict[str, Any]:
    at_ns = question.at_ns
    run = Rerun(question.folder, question.site, question.tag, at_ns, at_ns + AFTER_NS)
    run.run_to(at_ns)
    tag = run.service.tags.find(question.tag)
    explanation = None if tag is None else explanation_of(run.answers, tag, question.last)
    if explanation is None:
        raise BoxError(say("box_no_pose", "Tag {tag} had no pose then.", tag=repr(question.tag)))
    past = {
        "at_ns": at_ns,
        "run_from_ns": run.begin_ns,
        "states": [dict(zip(("t_ns", "state", "reason"), one, strict=True)) for one in run.states],
        "incidents": [*run.incidents],
        "causes": causes_of(run),
        "track": run.track(at_ns - MINUTE_NS, at_ns),
    }
    run.run_to(at_ns + AFTER_NS)
    newest_ns = explanation["pose"]["t_ns"]
    return explanation | {"past": past | {"next": run.track(newest_ns + 1, newest_ns + AFTER_NS)}}


def _compared(question: Question, what: WhatIf) -> dict[str, Any]:
    period = question.folder, question.site, question.tag, what.from_ns, what.to_ns
    as_was, other = Rerun(*period), Rerun(*period)
    as_was.run_to(what.from_ns)
    other.run_to(as_was.sure_ns or what.from_ns)  # a tag that just did not know goes on from where it last did
    as_was.run_to(what.to_ns)
    began = _change(other, question.tag, what)
    other.run_to(what.to_ns, adopt=False)
    tracks = [run.track(what.from_ns, what.to_ns) for run in (as_was, other)]
    return {
        "run_from_ns": as_was.begin_ns,
        "began_at_pose": began,
        "as_was": tracks[0],
        "what_if": tracks[1],
        "apart_m": math.dist(*(_last_place(track) for track in tracks)),
    }


def _last_place(track: dict[str, list[Any]]) -> tuple[float, float]:
    return (track["x"][-1], track["y"][-1]) if track["t_ns"] else (math.nan, math.nan)


def _change(run: Rerun, name: str, what: WhatIf) -> bool:
    """Change the settings of a run, whose tag goes on from where it is. Return whether it knows that.

    What already is as asked changes nothing: then the run tells what would have been without the changes that follow.
    """
    site, now_ns = run.service.site, run.service.clock.now_ns()
    before = site.tag_settings(name)
    after = what.settings.over(before)
    start = _place_of(run, after)
    changed = {anchor.number: anchor for anchor in what.anchors}
    anchors = [changed.pop(anchor.number, anchor) for anchor in site.site.anchors]
    update: dict[str, Any] = {"anchors": [*anchors, *changed.values()]}
    if what.declination_rad is not None:
        update["declination_rad"] = what.declination_rad
    changed_site = Site.model_validate(site.site.model_dump() | update)
    if (after, changed_site) == (before, site.site):
        return start is not None
    site.set_site(changed_site)
    run.service.take(Turn(now_ns))  # the engine follows the site first, which may move the track
    site.set_tag(name, after.model_copy(update={"start": start}))
    return start is not None


def _place_of(run: Rerun, after: TagSettings) -> StartPose | None:
    """Return where the tag is, as a start; None if it does not know.

    Its body faces where its course and the mounting of until then tell. Where the mounting changes, nobody knows to the
    second since when: the place allows for a while on another course.
    """
    pose = None if run.row is None else run.service.latest.row(run.row)
    if pose is None or not is_sure(pose):
        return None
    x, y, course, speed, sigma = (float(pose[name]) for name in ("x", "y", "heading", "speed", "sigma_pos"))
    before = run.settings.mount_angle_rad
    astray = abs(speed) * UNSURE_S if after.mount_angle_rad != before else 0.0
    return StartPose(x=x, y=y, heading_rad=course - (before or 0.0), std_m=max(sigma, 0.1) + astray)
