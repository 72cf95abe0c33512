"""Authentication and access control: certificates on the Zenoh network, API keys and tokens on the REST interface."""
