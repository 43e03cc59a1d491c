"""Drives and studies as they happen, in a page that this machine alone can open."""
