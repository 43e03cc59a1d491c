"""What a run leaves behind: the record in memory, the folder on disk."""
