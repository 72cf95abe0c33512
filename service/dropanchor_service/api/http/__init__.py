"""What every request passes: access, limits, errors, headers, and the server itself."""
