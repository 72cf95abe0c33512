"""What phones send over HTTP, as samples of tags."""
