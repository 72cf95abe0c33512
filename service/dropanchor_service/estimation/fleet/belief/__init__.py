"""The pose belief of one tag: a Gaussian mixture that nodes move and correct."""
