"""Build the answers of REST and Zenoh: aged poses, JSON, poses at a time, explanations, pages of a track."""
