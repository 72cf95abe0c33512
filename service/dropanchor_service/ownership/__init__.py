"""Whether this process serves its sites: always when it is alone, in a cluster as the owner of their bucket."""
