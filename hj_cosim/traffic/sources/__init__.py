"""Where traffic comes from: drawn at random, or placed by hand."""
