"""Estimate the offset between the clocks of a tag's motion and its ranges from what both say while the tag moves."""
