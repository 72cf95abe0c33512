"""What the messages of an MQTT broker mean."""
