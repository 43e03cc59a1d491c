"""What Ctrl-C is answered with, wherever it is pressed; nothing is imported here that takes time."""

INTERRUPTED = 130  # the exit status, 128 + SIGINT, as shells have it
MESSAGE = "interrupted; nothing half-written was left, and a study goes on with --resume"
