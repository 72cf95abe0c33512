"""Compiled passes over the messages of a turn: arrays in, arrays out, without the interpreter lock and without a
Python step per message or sample. Each file compiles by itself and calls no kernel of another file."""
