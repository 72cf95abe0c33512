"""A process without state that passes requests on to the owners of the sites, and joins what concerns all of them."""
