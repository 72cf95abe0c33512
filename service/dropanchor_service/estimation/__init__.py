"""Estimation, pure: functions and engines on values and rows. No clock, no I/O, nothing else of ours."""
