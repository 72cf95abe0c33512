"""Where north is at a site, from the tags whose tracks tell it.

The declinations d that tags tell, with deviations s, differ by their own errors and by t, the same for all (DerSimonian
and Laird):

    w = 1/s²    q = Σ w (d - Σ w d / Σ w)²    t² = max((q - (n - 1)) / (Σ w - Σ w² / Σ w), SPREAD_STD²)
    learned = Σ w' d / Σ w'    std² = 1 / Σ w'    with w' = 1 / (s² + t²)
"""

import cmath
import math
from collections.abc import Sequence
from typing import Any

from dropanchor_schemas.sentences import Sentence, phrase_of, say
from dropanchor_service.answers.answers import Answers
from dropanchor_service.store.norths import North
from dropanchor_service.store.tags import Tag

Answer = dict[str, Any]

SPREAD_STD = 0.14  # rad, by which 317 walks with a phone on 14 floors differed from the others of their floor
OFFERED_ABOVE = 2.0  # standard deviations


def site_north_of(answers: Answers) -> Answer:
    """Return the `SiteNorth` of a site."""
    told = answers.site.site.declination_rad
    known = _known(answers)
    learned = combined([north for _, north in known])
    error = None if learned is None else math.remainder(learned.declination_rad - told, math.tau)
    offered = learned is not None and error is not None and abs(error) > OFFERED_ABOVE * learned.std_rad
    text = _sentence(error, learned.std_rad, len(known)) if offered and learned and error is not None else ""
    return {
        "declination_rad": told,
        "learned_rad": None if learned is None else learned.declination_rad,
        "std_rad": None if learned is None else learned.std_rad,
        "tags": [{"tag": tag.name} | north._asdict() for tag, north in known],
        "offered": offered,
        "text": text,
        "phrase": phrase_of(text),
    }


def cure_by_others(answers: Answers, tag: Tag) -> str:
    """Return the sentence that offers a tag what others of its site tell; empty without an offer that it needs."""
    settings = answers.site.tag_settings(tag.name)
    by_itself = settings.start is not None and settings.start.heading_rad is not None
    if by_itself or settings.heading_source == "platform" or not tag.samples["imu"]:
        return ""
    text: str = site_north_of(answers)["text"]
    return text


def north_error_of(answers: Answers, tag: Tag) -> Answer | None:
    """Return the `LearnedNorth` of a tag, None if its track tells nothing."""
    north = tag.rows.norths.of(tag.row)
    if north is None:
        return None
    error = math.remainder(north.declination_rad - answers.site.site.declination_rad, math.tau)
    return {"error_rad": error, "std_rad": north.std_rad}


def combined(norths: Sequence[North]) -> North | None:
    """Return what tags tell together, None without any."""
    if not norths:
        return None
    about = cmath.phase(sum(cmath.rect(1.0, one.declination_rad) for one in norths))
    d = [math.remainder(one.declination_rad - about, math.tau) for one in norths]
    s2 = [one.std_rad**2 for one in norths]
    spread = max(_spread_var(d, s2), SPREAD_STD**2)
    w = [1.0 / (own + spread) for own in s2]
    mean = _mean(w, d)
    return North(math.remainder(about + mean, math.tau), math.sqrt(1.0 / sum(w)))


def _spread_var(d: Sequence[float], s2: Sequence[float]) -> float:
    """Return t² before its lower bound."""
    if len(d) < 2:
        return 0.0
    w = [1.0 / own for own in s2]
    mean, total = _mean(w, d), sum(w)
    q = sum(one * (value - mean) ** 2 for one, value in zip(w, d, strict=True))
    return (q - (len(d) - 1)) / (total - sum(one * one for one in w) / total)


def _mean(w: Sequence[float], d: Sequence[float]) -> float:
    return sum(one * value for one, value in zip(w, d, strict=True)) / sum(w)


def _known(answers: Answers) -> list[tuple[Tag, North]]:
    """Return the tags of the site whose tracks tell north, by name."""
    rows = answers.tags.rows
    tags = ((rows.at(row), north) for row, north in rows.norths.all())
    found = ((tag, north) for tag, north in tags if answers.tags.find(tag.name) is tag)
    return sorted(found, key=lambda one: one[0].name)


def _sentence(error_rad: float, std_rad: float, tags: int) -> Sentence:
    error = f"{abs(math.degrees(error_rad)):.0f}"
    within = f"{OFFERED_ABOVE * math.degrees(std_rad):.0f}"
    if tags == 1:
        return say(
            "site_north_of_one",
            "A tag of this site that knows where it started says that north is {error}° ± {within}° off. Apply that to "
            "all.",
            error=error,
            within=within,
        )
    return say(
        "site_north",
        "{tags} tags of this site that know where they started say that north is {error}° ± {within}° off. Apply that "
        "to all.",
        tags=tags,
        error=error,
        within=within,
    )
