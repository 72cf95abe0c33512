"""The product as a user gets it: the whole engine on what tags send, with more or less told."""
