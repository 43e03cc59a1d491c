"""One episode: world, planner, controller, recorder."""
