"""Who may do what: certificates and access control of the Zenoh network, keys and tokens of the REST interface."""
