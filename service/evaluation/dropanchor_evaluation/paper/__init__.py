"""The experiments of the paper, one per module. Each `run(...)` returns a `Section` of the report."""
