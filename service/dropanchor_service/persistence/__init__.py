"""What the sites have on disk, as the settings want it: where their files lie, and what reads and writes them."""
