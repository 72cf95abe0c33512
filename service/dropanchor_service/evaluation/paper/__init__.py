"""The experiments of the paper, one module each: `run(...)` gives a `Section` of the report."""
