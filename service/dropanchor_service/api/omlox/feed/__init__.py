"""The WebSocket of the omlox interface: topics, subscriptions, and what is sent to each client."""
