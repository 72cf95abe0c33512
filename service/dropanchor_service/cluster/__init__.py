"""One process of several serves a bucket of sites: the lease, what the others need to go on, and the rules."""
