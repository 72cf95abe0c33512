"""Bags of ROS and MCAP files: topics with messages."""
