"""Choose an engine and compile it before it is needed."""
