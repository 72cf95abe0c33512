"""The URL of a REST interface."""


def http_url(host: str, port: int, is_encrypted: bool) -> str:
    """Return the URL without a path. host: a name or an IP address."""
    scheme = "https" if is_encrypted else "http"
    return f"{scheme}://[{host}]:{port}" if ":" in host else f"{scheme}://{host}:{port}"
