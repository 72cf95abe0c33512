"""What the check of a tag's sensors found, as a sentence with its code."""

from dropanchor_schemas.sentences import Sentence
from dropanchor_service.estimation.plausibility.verdicts import Finding


def sentence_of(found: Finding) -> Sentence:
    return Sentence(found.sentence, f"sensor.{found.name}", {} if found.number is None else {"number": found.number})
