"""A bag through the predictor: what a live node would have answered to its messages."""
