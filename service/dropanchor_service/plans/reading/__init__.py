"""Read an uploaded file in a process of its own, which a hostile file may crash or stall without any harm."""
