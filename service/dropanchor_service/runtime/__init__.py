"""Services for every process: clock, logs, supervised threads, files, signals, the kernel cache."""
