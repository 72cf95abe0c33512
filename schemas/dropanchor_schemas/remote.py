"""The limits of what the service may set in a tag's program. This module needs only the standard library."""

MIN_BATCH_S, MAX_BATCH_S = 0.01, 5.0
MIN_IMU_HZ, MAX_IMU_HZ = 1.0, 1_000.0
