"""Floor plans: the images that people upload, and the plans that show them."""
