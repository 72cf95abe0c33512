"""What REST and Zenoh answer with: poses and their age, JSON, poses at a time, explanations, pages of a track."""
