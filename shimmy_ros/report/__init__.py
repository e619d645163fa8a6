"""What a bag of a run shows: measured motion beside the predictions, as figures and pictures."""
