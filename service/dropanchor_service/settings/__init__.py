"""The settings: their model, where they are read from, and the columns that an engine takes of them."""
