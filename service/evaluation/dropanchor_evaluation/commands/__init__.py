"""`dropanchor evaluate` and its parts. The entry point `evaluate` leads here."""
