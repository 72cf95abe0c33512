"""The Zenoh side of the service: session, intake of samples, queries to tag caches, queryables and publishers."""
