"""Everything around the routes: access control, limits, errors, headers, and the HTTP server."""
