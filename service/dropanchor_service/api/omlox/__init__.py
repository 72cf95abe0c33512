"""A second, thin interface beside `/api/v1`: the subset of the omlox Hub API v2 that existing clients use.

It reads and writes the same stores. Only what omlox knows and this service does not, such as the properties of a
trackable, has a store of its own.
"""
