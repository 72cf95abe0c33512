"""The fleet engine: one row of attitude, calibration and pose belief per tag, compiled over rows."""
