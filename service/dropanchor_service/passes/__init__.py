"""Compiled passes over the messages of a turn and the poses of an answer: arrays in, arrays out, without the
interpreter lock and without a Python step for each of them. Each file compiles by itself and calls no kernel of another
file."""
