"""What every process needs: clock, logs, threads that are watched, files, signals, the cache of compiled kernels."""
