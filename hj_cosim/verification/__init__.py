"""What is claimed, checked: tables, the filter's games, promises kept in traffic."""
