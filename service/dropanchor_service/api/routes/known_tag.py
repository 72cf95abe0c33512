"""Look up the tag that a request names."""

from dropanchor_schemas.sentences import say
from dropanchor_service.answers.answers import Answers
from dropanchor_service.api.http.errors import Kind, ProblemError
from dropanchor_service.store.tags import Tag


def known_tag(answers: Answers, name: str) -> Tag:
    """Return the tag with this name. Raises ProblemError."""
    tag = answers.tags.find(name)
    if tag is None or answers.tags.is_deleted(tag.row):
        raise unknown_tag(name)
    return tag


def unknown_tag(name: str) -> ProblemError:
    return ProblemError(
        Kind.UNKNOWN_TAG,
        say(
            "tag_unknown",
            "No message of tag {tag} was accepted, and it is not configured. The log of the service "
            "names the messages that it rejects.",
            tag=repr(name),
        ),
    )
