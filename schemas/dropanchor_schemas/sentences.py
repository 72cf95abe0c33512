"""Sentences for people that also carry a code and values, so that a page can say them in its own words and language."""

from typing import Any


class Sentence(str):
    """A sentence in English. code: what is said; it stays the same when the wording changes. values: what stands in the
    sentence, by name. A value that is a `Sentence`, too, also has `<name>.code` and `<name>.<its values>` there."""

    code: str
    values: dict[str, str]

    def __new__(cls, text: str, code: str, values: dict[str, str]) -> "Sentence":
        sentence = super().__new__(cls, text)
        sentence.code, sentence.values = code, values
        return sentence

    def __getnewargs__(self) -> tuple[str, str, dict[str, str]]:  # type: ignore[override]
        return str(self), self.code, self.values


def say(code: str, english: str, **values: object) -> Sentence:
    """Return a sentence. english: with `{name}` for each value.

    The code and the text stand in the call, so that tests can list all that is ever said.
    """
    flat = {}
    for name, value in values.items():
        flat[name] = str(value)
        if isinstance(value, Sentence):
            flat[f"{name}.code"] = value.code
            flat |= {f"{name}.{inner}": text for inner, text in value.values.items()}
    return Sentence(english.format(**values), code, flat)


def said_by(error: Exception) -> str:
    """Return the sentence of an error, which `str` would strip of its code."""
    first = error.args[0] if len(error.args) else None
    return first if isinstance(first, Sentence) else str(error)


def with_stop(text: str) -> str:
    """Return the sentence with a full stop, as one that stands alone."""
    return Sentence(f"{text}.", text.code, text.values) if isinstance(text, Sentence) else f"{text}."


def phrase_of(text: str | None) -> dict[str, Any] | None:
    """Return the `Phrase` of a text in JSON; None for one without a code."""
    return {"code": text.code, "values": text.values} if isinstance(text, Sentence) else None
