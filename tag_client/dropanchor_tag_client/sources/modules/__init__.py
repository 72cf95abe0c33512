"""UWB modules on a serial port: one parser per module, bytes in and reports out."""
