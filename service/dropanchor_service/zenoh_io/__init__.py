"""All that speaks Zenoh: the session, samples in, caches asked, queries answered, poses published."""
