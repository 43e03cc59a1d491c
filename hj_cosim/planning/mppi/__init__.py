"""A planner that samples: model predictive path integral control with the paper's reward and V."""
