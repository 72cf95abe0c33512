"""Where hypotheses are born or change in kind: the table, the loop that runs it, and a file per family of births."""
