"""The gear's limit cycles: predicted, followed along branches, and all there are at a point."""
