"""The paper's multi-agent safety-preserving control."""
