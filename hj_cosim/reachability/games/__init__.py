"""The games that come with the package, one a file, and what a game is."""
