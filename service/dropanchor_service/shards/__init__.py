"""Shards: processes of which each serves one bucket or stands by for any. Ray places, starts and restarts them."""
