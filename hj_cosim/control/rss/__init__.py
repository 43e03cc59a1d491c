"""The RSS proper response, the paper's baseline."""
