"""A light client that publishes the raw range and IMU samples of a tag."""
