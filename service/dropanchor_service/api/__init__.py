"""The REST interface, the pose stream and the dashboard. They depend on the store, not on an engine or on Zenoh."""
