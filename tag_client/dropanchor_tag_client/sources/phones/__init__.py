"""The motion of phones: readings of their sensors become IMU samples. The service imports this package too."""
