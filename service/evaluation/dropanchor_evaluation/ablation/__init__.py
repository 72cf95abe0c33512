"""What each rule of the engine buys: the rows of `product` with one rule off at a time."""
