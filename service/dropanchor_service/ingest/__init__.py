"""Turn messages into poses: buffer, decode, order, screen, fuse, store."""
