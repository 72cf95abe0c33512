"""Whether a tag's sensors can be believed, judged by its own samples before an estimator sees them."""
