"""The filters' small quadratic program."""
