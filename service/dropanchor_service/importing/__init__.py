"""Turn recordings of others into a folder that `dropanchor replay` reads."""
