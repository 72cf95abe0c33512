"""What a measurement says of a hypothesis, one file each: predicted value and H, variance, likelihood, weight."""
