"""From messages to poses: buffer, order, decode, screen, fuse, store."""
