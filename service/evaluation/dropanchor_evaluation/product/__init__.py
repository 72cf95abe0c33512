"""Evaluation of the whole engine on the samples of tags, with more or fewer settings configured."""
